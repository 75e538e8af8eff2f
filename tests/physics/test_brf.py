"""What canopies send back, against closed forms."""

import drjit as dr
import numpy as np
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.formats import meshes, rami
from dapple.formats.meshes import Mesh
from dapple.frames import direction_from_angles
from dapple.light import brf
from dapple.scene import traced
from dapple.scene.phase import phase_function
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, Surface, of_kinds

CELL = np.array([[0.0, 0.0], [4.0, 4.0]])
SUN = direction_from_angles(30.0, 0.0)


def optics(rho=0.0, tau=0.0, ground=0.0, bark=0.0):
    return Optics.of_tree(*(np.array([float(x)]) for x in (800.0, rho, tau, bark, ground)))


def looking(zenith_deg, azimuth_deg=0.0):
    """Views from a place in the sky down to the ground."""
    return -np.atleast_2d(direction_from_angles(zenith_deg, azimuth_deg))


def quad(x, y, z):
    corners = np.array([(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)], float)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def voxels(leaf_area_index):
    """A layer 1 m thick that fills the cell."""
    return xr.Dataset(
        {"plant_area_density_m2_m3": (("x", "y", "z"), np.full((4, 4, 1), leaf_area_index))},
        coords={"x": np.arange(4) + 0.5, "y": np.arange(4) + 0.5, "z": [1.5]},
        attrs={"voxel_size_m": 1.0, "leaf_angle_distribution": "spherical"},
    )


def discs(n=150, seed=4):
    """Leaf discs of random position and tilt in the cell."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    places = rng.uniform([0, 0, 0.4], [4, 4, 2.5], (n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([np.full(n, 0.2), places, normals])


def factor(scene, directions, leaf, *, sun=SUN, n_paths=30_000, cosine=False, **more):
    loaded = traced.load(scene, cell_m=CELL)
    views = brf.over_cell(loaded, directions, cosine=cosine)
    settings = {"max_orders": 60, "seed": 1, **more}
    received = brf.collect(loaded, views, sun, n_paths=n_paths, **settings)
    value, error = brf.reflectance_factor(received, leaf)
    return value[:, 0], error[:, 0]


def test_bare_ground_looks_the_same_from_everywhere():
    value, error = factor(Scene(), looking([0, 40, 75], [0, 90, 200]), optics(ground=0.3))
    np.testing.assert_allclose(value, 0.3, rtol=1e-6)
    assert error.max() < 1e-7


def test_a_leaf_that_covers_all_and_the_ground_below_share_light_by_a_geometric_series():
    leaf = Scene(of_kinds(leaf=quad((-1, 5), (-1, 5), 1.0)))
    rho, tau, ground = 0.4, 0.3, 0.5
    between = 1 - rho * ground
    value, error = factor(leaf, looking([0, 60]), optics(rho, tau, ground))
    assert value == pytest.approx(rho + tau**2 * ground / between, abs=4 * error.max())
    assert error.max() < 0.01

    loaded = traced.load(leaf, cell_m=CELL)
    below = brf.over_cell(loaded, np.array([[0.0, 0.0, 1.0]]), height_m=0.01, cosine=True)
    received = brf.collect(loaded, below, SUN, n_paths=30_000, max_orders=200, seed=2)
    for diffuse_share in (0.0, 1.0):
        down, error = brf.reflectance_factor(
            received, optics(rho, tau, ground), diffuse_share=diffuse_share
        )
        assert down[0, 0] == pytest.approx(tau / between, abs=4 * error[0, 0])


def test_ground_below_a_black_layer_is_dimmed_on_both_ways():
    zenith = np.array([0.0, 45.0, 75.0])
    value, error = factor(Scene(voxels=voxels(1.2)), looking(zenith, 70.0), optics(ground=0.5))
    slant = 1 / np.cos(np.radians(30.0)) + 1 / np.cos(np.radians(zenith))
    expected = 0.5 * np.exp(-0.5 * 1.2 * slant)
    assert (np.abs(value - expected) < 4 * error).all()
    assert (error < 0.03 * expected).all()


@pytest.mark.parametrize(("rho", "tau"), [(1e-6, 0.0), (0.0, 1e-6), (1e-6, 1e-6)])
def test_a_layer_scatters_once_by_its_phase_function(rho, tau):
    zenith, azimuth = np.array([0.0, 30.0, 60.0]), np.array([0.0, 180.0, 20.0])
    value, error = factor(Scene(voxels=voxels(2.0)), looking(zenith, azimuth), optics(rho, tau))
    towards = direction_from_angles(zenith, azimuth)
    angle = np.pi - np.arccos(np.clip(towards @ SUN, -1, 1))
    slant = 1 / SUN[2] + 1 / towards[:, 2]
    phase = phase_function(angle, np.array(rho), np.array(tau)) * (rho + tau)
    expected = np.pi * phase / (SUN[2] + towards[:, 2]) * (1 - np.exp(-0.5 * 2.0 * slant))
    assert (np.abs(value - expected) < 4 * error + 1e-3 * expected).all()
    assert (error < 0.05 * expected).all()


def test_sun_and_view_may_change_places():
    scene, leaf = Scene(of_kinds(leaf=meshes.of_discs(discs()))), optics(0.45, 0.4, 0.2)
    places = [(30.0, 0.0), (55.0, 130.0)]
    (first, error_1), (second, error_2) = (
        factor(scene, looking(*view), leaf, sun=direction_from_angles(*sun), n_paths=60_000)
        for view, sun in (places, places[::-1])
    )
    assert first[0] == pytest.approx(second[0], abs=4 * np.hypot(error_1, error_2)[0])
    assert error_1[0] < 0.01 * first[0]


def test_nothing_is_lost_where_nothing_absorbs():
    scene = Scene(of_kinds(leaf=meshes.of_discs(discs())), voxels(0.3))
    up = looking([0.0])
    value, error = factor(scene, up, optics(0.6, 0.4, 1.0), cosine=True, max_orders=250)
    assert value[0] == pytest.approx(1.0, abs=4 * error[0])
    assert error[0] < 0.02


def test_leaves_that_reach_over_a_side_come_in_at_the_other():
    """A shift of all leaves, so that many lie across the sides, changes nothing."""
    leaves, leaf = discs(), optics(0.45, 0.4, 0.2)
    shifted = leaves.copy()
    shifted[:, 1:3] += [3.1, -1.7]
    (first, error), (second, _) = (
        factor(
            Scene(of_kinds(leaf=meshes.of_discs(d))), looking([50.0], 30.0), leaf, n_paths=60_000
        )
        for d in (leaves, shifted)
    )
    assert first[0] == pytest.approx(second[0], abs=4 * 1.5 * error[0])
    assert error[0] < 0.01 * first[0]


def test_a_repeated_cell_looks_like_many_of_them():
    """A cell of 2 × 2 copies is the same endless scene as one copy repeated."""
    one, leaf = meshes.of_discs(discs()), optics(0.45, 0.4, 0.2)
    places = np.array([(x, y, 0.0) for x in (0.0, 4.0) for y in (0.0, 4.0)])
    small = traced.load(Scene(of_kinds(leaf=one)), cell_m=CELL)
    large = traced.load(Scene([Surface(one, places_m=places)]), cell_m=2 * CELL)
    found = []
    for scene in (small, large):
        views = brf.over_cell(scene, looking([60.0], 75.0))
        received = brf.collect(scene, views, SUN, n_paths=30_000, max_orders=60, seed=3)
        found.append(np.array(brf.reflectance_factor(received, leaf))[:, 0, 0])
    assert found[0][0] == pytest.approx(found[1][0], abs=4 * np.hypot(found[0][1], found[1][1]))
    assert found[0][1] < 0.02 * found[0][0]


def test_one_trace_serves_all_bands():
    scene = traced.load(Scene(of_kinds(leaf=meshes.of_discs(discs()))), cell_m=CELL)
    views = brf.over_cell(scene, looking([0.0, 40.0]))
    received = brf.collect(scene, views, SUN, n_paths=5000, max_orders=100, seed=1)
    bands = Optics.of_tree(
        np.array([550.0, 850.0]),
        np.array([0.1, 0.45]),
        np.array([0.05, 0.4]),
        np.zeros(2),
        np.array([0.1, 0.2]),
    )
    both = brf.reflectance_factor(received, bands)[0]
    assert (both[:, 1] > both[:, 0]).all()
    second = brf.reflectance_factor(received, optics(0.45, 0.4, 0.2))[0]
    np.testing.assert_allclose(both[:, 1], second[:, 0], rtol=1e-12)


def test_the_answer_depends_neither_on_threads_nor_on_blocks(monkeypatch):
    scene = traced.load(Scene(of_kinds(leaf=meshes.of_discs(discs())), voxels(0.5)), cell_m=CELL)
    views = brf.over_cell(scene, looking([10.0, 40.0]))
    threads = dr.thread_count()
    try:
        found = []
        for n_threads, block in ((1, 1 << 16), (2, 1 << 16), (2, 3000)):
            dr.set_thread_count(n_threads)
            monkeypatch.setattr(brf, "PATHS_PER_KERNEL", block)
            found.append(brf.collect(scene, views, SUN, n_paths=6000, max_orders=50, seed=1))
    finally:
        dr.set_thread_count(threads)
    for name in ("view", "replicate", "source", "orders", "weight"):
        assert getattr(found[0], name).tobytes() == getattr(found[1], name).tobytes()
        np.testing.assert_allclose(getattr(found[0], name), getattr(found[2], name), rtol=1e-12)


def test_discs_keep_their_area_and_their_tilt(tmp_path):
    table = discs(20)
    np.savetxt(tmp_path / "discs.def", table)
    read = rami.read_discs(tmp_path / "discs.def")
    mesh = meshes.of_discs(read)
    assert mesh.n_elements == 20
    np.testing.assert_allclose(mesh.element_area_m2, np.pi * 0.2**2, rtol=1e-12)
    along = np.abs((mesh.element_normal * table[:, 4:]).sum(axis=1))
    np.testing.assert_allclose(along, 1.0, rtol=1e-12)


def test_a_file_with_other_columns_is_named(tmp_path):
    np.savetxt(tmp_path / "discs.def", np.ones((3, 3)))
    with pytest.raises(InputError, match=r"discs\.def.*3 columns"):
        rami.read_discs(tmp_path / "discs.def")


def test_voxels_wider_than_the_cell_are_refused():
    with pytest.raises(InputError, match="cell_m"):
        traced.load(Scene(voxels=voxels(1.0)), cell_m=CELL / 2)
