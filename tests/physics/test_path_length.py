"""Plant area density from path lengths: known turbid bodies give their density back."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.structure.path_length import PartGrid, plant_area_density, trace

G = 0.5


def sphere(radius_m=2.0, size_m=0.05):
    n = round(2 * radius_m / size_m)
    at = (np.arange(n) + 0.5) * size_m - radius_m
    inside = sum(a**2 for a in np.meshgrid(at, at, at, indexing="ij")) <= radius_m**2
    return PartGrid(np.where(inside, 0, -1).astype(np.int32), np.full(3, -radius_m), size_m)


def box(size_m=0.25, edges_m=(4.0, 4.0, 3.0), layers=1):
    shape = [round(e / size_m) for e in edges_m]
    part = np.empty(shape, np.int32)
    part[:] = layers - 1 - np.arange(shape[2]) * layers // shape[2]
    return PartGrid(part, np.zeros(3), size_m)


def beams(grid, n, rng, zenith_deg=0.0):
    """Pulses that cross the whole middle of a body, from above."""
    extent = np.array(grid.part.shape) * grid.size_m
    zenith, azimuth = np.radians(zenith_deg), rng.random(n) * 2 * np.pi
    down = np.stack(
        [np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth),
         np.full(n, -np.cos(zenith))], axis=1,
    )  # fmt: skip
    middle = grid.corner_m + extent / 2
    aim = middle + (rng.random((n, 3)) - 0.5) * extent * [1, 1, 0]
    return aim - 20.0 * down, down


def entry_and_exit(grid, start, down):
    """Analytic stretch of each beam in the sphere that `grid` stands for."""
    b = (start * down).sum(axis=1)
    root = b**2 - (start**2).sum(axis=1) + (grid.corner_m[0]) ** 2
    half = np.sqrt(np.maximum(root, 0))
    return -b - half, -b + half


def one_return_each(t_in, t_out, density, rng):
    """Each beam stops once: in the body after a free path, or on the ground far below it."""
    free = rng.exponential(1 / (G * density), len(t_in))
    hit = free < t_out - t_in
    return np.where(hit, t_in + free, 1000.0), np.where(hit, 0, -1)


@pytest.mark.parametrize("density", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("zenith_deg", [0.0, 35.0])
def test_a_turbid_sphere_gives_its_density_back(density, zenith_deg):
    rng, grid = np.random.default_rng(1), sphere()
    start, down = beams(grid, 40_000, rng, zenith_deg)
    distance, part = one_return_each(*entry_and_exit(grid, start, down), density, rng)
    paths = trace(grid, 1, start, down, np.arange(40_001), distance, np.ones(40_000), part)
    found = plant_area_density(paths, projection=G, max_density_m2_m3=20.0)
    assert found[0] == pytest.approx(density, rel=0.03)


def test_the_mean_path_alone_would_come_out_too_low():
    rng, grid, density = np.random.default_rng(2), sphere(), 2.0
    start, down = beams(grid, 40_000, rng)
    distance, part = one_return_each(*entry_and_exit(grid, start, down), density, rng)
    paths = trace(grid, 1, start, down, np.arange(40_001), distance, np.ones(40_000), part)
    mean = (paths.weight @ paths.length_m)[0] / paths.entered[0]
    naive = -np.log(1 - paths.stopped[0] / paths.entered[0]) / (G * mean)
    assert naive < 0.9 * density


def test_layers_of_a_box_are_told_apart_by_what_reached_them():
    rng, grid, densities = np.random.default_rng(3), box(layers=3), np.array([0.5, 2.0, 1.0])
    n = 60_000
    xy = rng.uniform(0.2, 3.8, (n, 2))
    start = np.column_stack([xy, np.full(n, 10.0)])
    down = np.tile([0.0, 0.0, -1.0], (n, 1))
    edges = 7.0 + np.arange(4)
    passed = np.concatenate([[0], np.cumsum(G * densities)])
    depth = rng.exponential(1, n)
    distance = np.where(depth < passed[-1], np.interp(depth, passed, edges), 1000.0)
    part = np.where(depth < passed[-1], np.searchsorted(passed, depth) - 1, -1)
    paths = trace(grid, 3, start, down, np.arange(n + 1), distance, np.ones(n), part)
    found = plant_area_density(paths, projection=G, max_density_m2_m3=20.0)
    np.testing.assert_allclose(found, densities, rtol=0.04)


def test_returns_that_each_stop_a_share_count_by_their_light():
    """Every pulse loses exactly the expected light in the box: the equation is then exact."""
    grid, density, n = box(), 1.3, 500
    lost = 1 - np.exp(-G * density * 3.0)
    xy = np.random.default_rng(4).uniform(0.5, 3.5, (n, 2))
    start = np.column_stack([xy, np.full(n, 10.0)])
    down = np.tile([0.0, 0.0, -1.0], (n, 1))
    paths = trace(
        grid, 1, start, down, np.arange(n + 1) * 2,
        np.tile([8.5, 50.0], n), np.tile([lost, 1 - lost], n), np.tile([0, -1], n),
    )  # fmt: skip
    assert paths.entered[0] == pytest.approx(n)
    found = plant_area_density(paths, projection=G, max_density_m2_m3=20.0)
    assert found[0] == pytest.approx(density, rel=2 / n)


def test_light_stopped_above_does_not_enter_what_lies_below():
    grid = box(layers=2)
    start, down = np.array([[2.0, 2.0, 10.0]]), np.array([[0.0, 0.0, -1.0]])
    paths = trace(
        grid, 2, start, down, np.array([0, 2]), np.array([7.5, 30.0]), np.array([0.7, 0.3]),
        np.array([0, -1]),
    )  # fmt: skip
    np.testing.assert_allclose(paths.entered, [1.0, 0.3])
    np.testing.assert_allclose(paths.weight @ paths.length_m / paths.entered, [1.5, 1.5])


def test_slanting_beams_have_their_slant_length():
    grid, zenith = box(size_m=0.1, edges_m=(6.0, 6.0, 1.0)), np.radians(40)
    start = np.array([[1.0, 3.0, 5.0]])
    down = np.array([[np.sin(zenith), 0.0, -np.cos(zenith)]])
    paths = trace(
        grid, 1, start, down, np.array([0, 1]), np.array([90.0]), np.ones(1),
        np.array([-1]),
    )  # fmt: skip
    length = (paths.weight @ paths.length_m)[0]
    assert length == pytest.approx(1 / np.cos(zenith), rel=1e-6)


def test_a_part_that_nothing_enters_is_unknown_and_a_closed_one_stays_finite():
    grid, n = box(layers=2), 50
    start = np.column_stack([np.full((n, 2), 2.01), np.full(n, 10.0)])
    down = np.tile([0.0, 0.0, -1.0], (n, 1))
    paths = trace(
        grid, 2, start, down, np.arange(n + 1), np.full(n, 7.5), np.ones(n), np.zeros(n, int)
    )
    found = plant_area_density(paths, projection=G, max_density_m2_m3=20.0)
    assert found[0] == pytest.approx(np.log(2 * n + 1) / (G * 1.5))
    assert np.isnan(found[1])
    assert plant_area_density(paths, projection=G, max_density_m2_m3=3.0)[0] == 3.0


def test_few_pulses_give_the_density_without_bias():
    """Twelve pulses a part, many parts: the mean is right, though single parts scatter."""
    rng, density, depth_m, n = np.random.default_rng(5), 1.0, 1.0, 12
    grid = PartGrid(np.arange(2500, dtype=np.int32).reshape(50, 50, 1), np.zeros(3), depth_m)
    xy = np.repeat(np.stack(np.mgrid[:50, :50], axis=-1).reshape(-1, 2) + 0.5, n, axis=0)
    start = np.column_stack([xy, np.full(len(xy), 1.0)])
    down = np.tile([0.0, 0.0, -1.0], (len(xy), 1))
    free = rng.exponential(1 / (G * density), len(xy))
    distance = np.where(free < depth_m, free, 1000.0)
    part = np.where(free < depth_m, np.repeat(np.arange(2500), n), -1)
    paths = trace(grid, 2500, start, down, np.arange(len(xy) + 1), distance, np.ones(len(xy)), part)
    found = plant_area_density(paths, projection=G, max_density_m2_m3=20.0)
    assert found.mean() == pytest.approx(density, rel=0.03)


def test_a_projection_beyond_one_is_refused():
    grid = box()
    paths = trace(
        grid, 1, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(1, np.int64), np.zeros(0),
        np.zeros(0), np.zeros(0, np.int64),
    )  # fmt: skip
    with pytest.raises(InputError, match="projection"):
        plant_area_density(paths, projection=1.5, max_density_m2_m3=8.0)
