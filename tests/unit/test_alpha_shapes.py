"""Alpha shapes: volume, inside, and even random points."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.structure import alpha_shapes


def ball(n=4000, radius_m=2.0, seed=1):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3))
    points *= radius_m * rng.random((n, 1)) ** (1 / 3) / np.linalg.norm(points, axis=1)[:, None]
    return points


def box(size_m, step_m, at=(0, 0, 0)):
    axes = [np.arange(0, s + step_m / 2, step_m) for s in size_m]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid + np.random.default_rng(1).normal(0, 1e-4, grid.shape) + at


def test_a_box_has_its_volume():
    shape = alpha_shapes.build(box((2, 1, 1), 0.1), alpha_m=0.3)
    assert shape.volume_m3 == pytest.approx(2.0, rel=2e-3)


def test_a_ball_has_nearly_its_volume():
    shape = alpha_shapes.build(ball(20_000), alpha_m=0.6)
    assert shape.volume_m3 == pytest.approx(4 / 3 * np.pi * 8, rel=0.05)


def test_a_gap_wider_than_the_radius_stays_open_and_a_narrow_one_closes():
    two = np.concatenate([box((1, 1, 1), 0.2), box((1, 1, 1), 0.2, at=(2, 0, 0))])
    apart, together = alpha_shapes.build(two, 0.4), alpha_shapes.build(two, 5.0)
    middle = np.array([[1.5, 0.5, 0.5]])
    assert not apart.contains(middle)[0]
    assert together.contains(middle)[0]
    assert apart.volume_m3 == pytest.approx(2.0, rel=5e-3)


def test_inside_and_outside_are_told_apart():
    shape = alpha_shapes.build(ball(500), alpha_m=1.2)
    assert shape.contains(np.zeros((1, 3)))[0]
    assert not shape.contains(np.array([[2.5, 0, 0], [0, 0, 100.0]])).any()


def test_random_points_are_inside_and_evenly_spread():
    shape = alpha_shapes.build(box((2, 1, 1), 0.1), alpha_m=0.3)
    n = 20_000
    points = alpha_shapes.sample(shape.corners_m, shape.volumes_m3, n, np.random.default_rng(3))
    assert shape.contains(points[:300]).mean() > 0.99  # on faces rounding may say either
    counts = np.histogramdd(points, bins=(4, 2, 2), range=[(0, 2), (0, 1), (0, 1)])[0]
    expected = n / 16
    # Sixteen cells: chi² has mean 15 and standard deviation √30.
    assert ((counts - expected) ** 2 / expected).sum() < 15 + 4 * np.sqrt(30)


def test_the_same_seed_gives_the_same_points():
    shape = alpha_shapes.build(ball(500), alpha_m=1.0)
    one, two = (
        alpha_shapes.sample(shape.corners_m, shape.volumes_m3, 50, np.random.default_rng(7))
        for _ in range(2)
    )
    np.testing.assert_array_equal(one, two)


def test_drawn_voxels_have_the_volume_and_only_it():
    shape = alpha_shapes.build(ball(1000), alpha_m=1.0)
    grid = np.full((50, 50, 50), -1, np.int32)
    alpha_shapes.draw(shape.corners_m, np.zeros(len(shape), int), grid, np.full(3, -2.5), 0.1)
    assert (grid == 0).sum() * 1e-3 == pytest.approx(shape.volume_m3, rel=0.01)
    index = np.argwhere(grid == 0)[::10]
    assert shape.contains(-2.5 + (index + 0.5) * 0.1).all()


def test_radius_of_a_regular_tetrahedron():
    corners = np.array([[[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]], float)
    assert alpha_shapes.circumradius_m(corners)[0] == pytest.approx(np.sqrt(3))
    flat = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]], float)
    assert np.isinf(alpha_shapes.circumradius_m(flat)[0])


@pytest.mark.parametrize("points", [np.zeros((3, 3)), np.eye(3)[[0, 1, 0, 1, 0]], np.zeros((9, 3))])
def test_points_that_span_no_volume_give_an_empty_shape(points):
    shape = alpha_shapes.build(points, 1.0)
    assert len(shape) == 0
    assert shape.volume_m3 == 0
    assert not shape.contains(np.zeros((1, 3)))[0]


def test_points_of_no_volume_and_a_radius_of_nothing_are_refused():
    with pytest.raises(InputError, match="no volume"):
        alpha_shapes.sample(np.zeros((0, 4, 3)), np.zeros(0), 5, np.random.default_rng(1))
    with pytest.raises(InputError, match="alpha_m"):
        alpha_shapes.build(ball(100), 0.0)
