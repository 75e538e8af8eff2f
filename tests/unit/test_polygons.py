"""Polygons reconstructed from points lie where the leaves are, with their area and tilt."""

import numba
import numpy as np
import pytest

from dapple.errors import EmptyCloudError, InputError
from dapple.structure.polygons import HALF_POINT_SPACING_M, reconstruct

HEXAGON_AREA = 3 * np.sqrt(3) / 2  # of a hexagon whose corners lie at distance 1


def turned(points_m, tilt_deg):
    """Turn points about the x axis."""
    c, s = np.cos(np.radians(tilt_deg)), np.sin(np.radians(tilt_deg))
    return points_m @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])


def square(side_m, tilt_deg=0.0, spacing_m=0.005, centre_m=(0.05, 0.05, 0.05)):
    """Points of a flat square leaf, its edge included."""
    steps = np.arange(0, side_m + spacing_m / 2, spacing_m) - side_m / 2
    x, y = np.meshgrid(steps, steps)
    flat = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return turned(flat, tilt_deg) + centre_m


def outline(mesh, element):
    """Corners of one polygon in order."""
    faces = mesh.faces[mesh.element == element]
    return mesh.vertices_m[np.concatenate([faces[0, :2], faces[:, 2]])]


def test_a_flat_square_leaf_keeps_its_area_and_its_tilt():
    mesh = reconstruct(square(0.04, tilt_deg=35), voxel_size_m=0.10, buffer_m=0.0, seed=1)
    assert mesh.area_m2 == pytest.approx(0.04**2, rel=1e-6)
    assert mesh.tilt_deg[0] == pytest.approx(35, abs=0.01)
    assert mesh.element_normal[0, 2] > 0


def test_a_polygon_lies_in_the_plane_of_least_squares_of_its_points():
    rng = np.random.default_rng(3)
    for _ in range(20):
        spread = rng.standard_normal((3, 3)) * [0.012, 0.008, 0.002]
        points_m = 0.05 + (rng.uniform(-1, 1, (30, 3)) @ spread).clip(-0.049, 0.049)
        mesh = reconstruct(points_m, voxel_size_m=0.10, buffer_m=0.0, seed=1)
        least = np.linalg.svd(points_m - points_m.mean(axis=0))[2][2]
        assert abs(mesh.element_normal[0] @ least) == pytest.approx(1.0, abs=1e-9)


def test_a_buffer_of_half_the_spacing_gives_each_point_its_own_area():
    points = square(0.04, tilt_deg=20, spacing_m=0.01)  # 25 points, each stands for 1 cm²
    mesh = reconstruct(points, voxel_size_m=0.10, buffer_m=0.005, seed=1)
    assert mesh.area_m2 == pytest.approx(25 * 0.01**2, rel=1e-6)


def test_every_edge_moves_outwards_by_the_buffer():
    """The authors' R code moves corners away from the centroid instead, and edges by less."""
    triangle = np.array([[0.01, 0.01, 0.02], [0.04, 0.01, 0.02], [0.02, 0.03, 0.02]])
    mesh = reconstruct(triangle, buffer_m=0.002, mitre_limit=10.0, seed=1)
    corners = outline(mesh, 0)[:, :2]
    edges = np.roll(corners, -1, axis=0) - corners
    across = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    beyond = (corners * across).sum(axis=1) - (triangle[:, :2] @ across.T).max(axis=0)
    assert len(corners) == 3
    assert np.abs(beyond) == pytest.approx(0.002, rel=1e-9)
    radial = triangle[:, :2] - triangle[:, :2].mean(axis=0)
    radial *= 1 + 0.002 / np.linalg.norm(radial, axis=1, keepdims=True)
    x, y = radial.T
    radial_area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    assert mesh.area_m2 > 1.1 * radial_area


def test_a_needle_is_not_lengthened_beyond_the_mitre_limit():
    needle = np.array([[0.001, 0.025, 0.02], [0.049, 0.025, 0.02], [0.049, 0.0251, 0.02]])
    corners = outline(reconstruct(needle, buffer_m=0.005, seed=1), 0)
    assert corners[:, 0].min() == pytest.approx(0.001 - np.sqrt(2) * 0.005, abs=1e-5)


def test_polygons_are_convex_planar_and_hold_their_points():
    rng = np.random.default_rng(3)
    points = rng.random((4000, 3)) * [0.5, 0.5, 0.5]
    mesh = reconstruct(points, seed=1)
    voxel = np.floor(points / 0.05).astype(int)
    keys, index, n = np.unique(voxel, axis=0, return_inverse=True, return_counts=True)
    assert mesh.n_elements == len(keys)
    for element in np.flatnonzero(n >= 4)[:100]:
        corners = outline(mesh, element)
        normal = mesh.element_normal[element]
        edges = np.roll(corners, -1, axis=0) - corners
        inside = np.cross(normal, edges)
        inside /= np.linalg.norm(inside, axis=1, keepdims=True)
        assert np.ptp(corners @ normal) < 1e-12
        assert ((np.cross(edges, np.roll(edges, -1, axis=0)) @ normal) > -1e-15).all()
        gap = ((points[index == element][:, None] - corners) * inside).sum(axis=2)
        assert gap.min() >= (1 - 1e-6) * HALF_POINT_SPACING_M * 0.999


def test_one_or_two_points_give_a_hexagon_a_third_of_the_voxel_wide():
    """A third of the voxel size is the diameter, as the text says, not the radius."""
    points = np.array([[0.01, 0.01, 0.01], [0.02, 0.02, 0.03], [0.06, 0.01, 0.01]])
    mesh = reconstruct(points, voxel_size_m=0.05, seed=1)
    assert mesh.n_elements == 2
    assert mesh.element_area_m2 == pytest.approx(HEXAGON_AREA * (0.05 / 6) ** 2, rel=1e-9)
    assert outline(mesh, 0).mean(axis=0) == pytest.approx([0.015, 0.015, 0.02])
    assert outline(mesh, 1).mean(axis=0) == pytest.approx([0.06, 0.01, 0.01])


def test_hexagons_are_turned_to_all_sides_alike():
    """The authors' code turns by at most 45° about each axis: most would lie near level."""
    cells = np.stack(np.meshgrid(*[np.arange(20)] * 3), axis=-1).reshape(-1, 3)
    mesh = reconstruct((cells + 0.5) * 0.05, seed=7)
    height = np.abs(mesh.element_normal[:, 2])
    assert mesh.n_elements == 8000
    # Uniform on the sphere: the normal's height is uniform, 1/√(12·8000) = 0.0032 is its error.
    assert height.mean() == pytest.approx(0.5, abs=0.015)
    assert np.mean(height < 0.25) == pytest.approx(0.25, abs=0.02)
    spoke = mesh.vertices_m[mesh.faces[np.searchsorted(mesh.element, np.arange(8000)), 0]]
    spoke -= np.stack([outline(mesh, k).mean(axis=0) for k in range(8000)])
    assert np.abs(spoke[:, 2]).mean() / (0.05 / 6) == pytest.approx(0.5, abs=0.015)


@pytest.mark.parametrize("along", [0, 1, 2])
def test_a_strip_keeps_its_area_whichever_axis_it_lies_along(along):
    """4 by 1 cm, thinner than the noise across: its plane is that of its two longer edges."""
    u, v = np.meshgrid([0.004, 0.024, 0.044], [0.01, 0.02], indexing="ij")
    strip = np.full((6, 3), 0.02)
    strip[:, along], strip[:, (along + 1) % 3] = u.ravel(), v.ravel()
    mesh = reconstruct(strip, buffer_m=0.0, seed=1)
    assert mesh.area_m2 == pytest.approx(0.04 * 0.01, rel=1e-9)
    assert abs(mesh.element_normal[0, (along + 2) % 3]) == pytest.approx(1.0)


def test_points_on_a_line_give_a_rectangle_as_wide_as_the_buffer_asks():
    line = np.array([[0.01, 0.02, 0.02]]) + np.arange(4)[:, None] * [0.006, 0.004, 0.0]
    mesh = reconstruct(line, buffer_m=0.003, seed=1)
    length = 3 * np.hypot(0.006, 0.004)
    assert len(outline(mesh, 0)) == 4
    assert mesh.area_m2 == pytest.approx((length + 0.006) * 0.006, rel=1e-6)


def test_points_in_one_place_give_the_hexagon():
    mesh = reconstruct(np.full((5, 3), 0.02), seed=1)
    assert mesh.area_m2 == pytest.approx(HEXAGON_AREA * (0.05 / 6) ** 2, rel=1e-9)


def test_polygons_come_in_the_order_of_their_voxels():
    points = np.array([[0.12, 0.0, 0.0], [-0.03, 0.0, 0.0], [-0.03, 0.0, 0.07], [-0.03, -0.06, 0]])
    mesh = reconstruct(points, seed=1)
    centres = [outline(mesh, k).mean(axis=0) for k in range(4)]
    assert np.array(centres) == pytest.approx(points[[3, 1, 2, 0]])


@pytest.fixture
def one_thread():
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(threads)


def test_the_number_of_threads_changes_no_byte(one_thread):
    points = np.random.default_rng(5).random((20_000, 3))
    alone = reconstruct(points, seed=11)
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    together = reconstruct(points, seed=11)
    assert together.vertices_m.tobytes() == alone.vertices_m.tobytes()
    assert together.faces.tobytes() == alone.faces.tobytes()


def test_a_voxel_does_not_depend_on_what_is_elsewhere():
    points = np.random.default_rng(5).random((500, 3))
    few, more = (reconstruct(points[:n], seed=11) for n in (1, 500))
    voxel = np.unique(np.floor(points / 0.05), axis=0, return_inverse=True)[1][0]
    if np.count_nonzero((np.floor(points / 0.05) == np.floor(points[0] / 0.05)).all(axis=1)) == 1:
        assert outline(more, voxel) == pytest.approx(outline(few, 0))
    other = reconstruct(points[:1], seed=12)
    assert not np.allclose(other.vertices_m, few.vertices_m)


def test_no_points_is_an_error_that_says_so():
    with pytest.raises(EmptyCloudError, match=r"no leaf points .* check the reflectance threshold"):
        reconstruct(np.empty((0, 3)), seed=1, what="leaf")


def test_points_that_are_not_finite_are_refused():
    with pytest.raises(InputError, match="1 points that are not finite"):
        reconstruct(np.array([[0.0, np.nan, 0.0], [1, 1, 1]]), seed=1)


def test_points_kilometres_away_are_refused():
    with pytest.raises(InputError, match="far outliers"):
        reconstruct(np.array([[0.0, 0.0, 0.0], [1e6, 0, 0]]), seed=1)
