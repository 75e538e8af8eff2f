"""The share of the sun that sensors see, against closed forms."""

import drjit as dr
import numpy as np
import pytest
from tests.physics.slab import turbid_slab

from dapple.formats.meshes import Mesh
from dapple.light import rays_to_sky
from dapple.light.visibility import sunlit
from dapple.scene import traced
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

SENSOR = np.array([[0.0, 0.0, 0.5]])
UP = np.array([[0.0, 0.0, 1.0]])
SUN_RADIUS = np.radians(0.5 * SUN_DIAMETER_DEG)


def see(scene, sensors_m, directions, **more):
    settings = {"tolerance": 1e-3, "max_rays": 1 << 16, "seed": 1}
    settings |= {"sun_diameter_deg": SUN_DIAMETER_DEG, **more}
    return sunlit(traced.load(scene), sensors_m, directions, **settings)


def half_plane(height_m):
    """Opaque where x > 0."""
    corners = [(0, -50, height_m), (50, -50, height_m), (50, 50, height_m), (0, 50, height_m)]
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(np.array(corners, float), faces, np.zeros(2, np.int32))


def directions(zenith_deg, azimuth_deg=0.0):
    z, a = np.broadcast_arrays(np.radians(zenith_deg), np.radians(azimuth_deg))
    return np.stack([np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)], axis=-1)


def seen_beside_an_edge(distance):
    """Part of a unit disc beyond a line at this distance from its middle, into the shade."""
    s = np.clip(distance, -1, 1)
    return (np.arccos(s) - s * np.sqrt(1 - s * s)) / np.pi


def test_by_day_an_open_place_sees_all_of_the_sun_and_by_night_none():
    found = see(Scene(), SENSOR, directions([0.0, 60.0, 89.0, 91.0, 150.0]))
    assert (found.share[:, 0] == [1, 1, 1, 0, 0]).all()
    assert (found.n_rays[0] > 0).tolist() == [True, True, True, False, False]


@pytest.mark.parametrize("leaf_area_index", [0.5, 1.0, 2.0, 4.0, 6.0])
def test_a_black_layer_dims_a_parallel_beam_by_its_slant_depth(leaf_area_index):
    zenith_deg = np.array([0.0, 30.0, 60.0, 75.0])
    found = see(
        Scene(voxels=turbid_slab(leaf_area_index)),
        SENSOR,
        directions(zenith_deg, 137.0),
        sun_diameter_deg=0.0,
    )
    expected = np.exp(-0.5 * leaf_area_index / np.cos(np.radians(zenith_deg)))
    np.testing.assert_allclose(found.share.mean(axis=0)[0], expected, rtol=1e-5)
    assert (found.standard_error == 0).all()


@pytest.mark.parametrize("distribution", ["planophile", "erectophile"])
def test_leaf_angles_change_the_slant_depth_by_their_projection(distribution):
    """Overhead, G is the mean cosine of the inclination: 8 / 3π for planophile, 4 / 3π for
    erectophile leaves."""
    layer = turbid_slab(1.0, distribution=distribution)
    found = see(Scene(voxels=layer), SENSOR, UP, sun_diameter_deg=0.0)
    projection = {"planophile": 8, "erectophile": 4}[distribution] / (3 * np.pi)
    assert found.share.mean() == pytest.approx(np.exp(-projection), rel=1e-4)


def test_in_the_penumbra_of_an_edge_errors_are_what_they_are_said_to_be():
    height_m = 4.0
    place = np.linspace(-1.2, 1.2, 61)
    sensors_m = np.stack([place * height_m * np.sin(SUN_RADIUS), 0 * place, 0 * place], axis=1)
    found = see(Scene(of_kinds(leaf=half_plane(height_m))), sensors_m, UP, tolerance=0.004)
    error = found.share.mean(axis=0)[:, 0] - seen_beside_an_edge(place)
    assert np.sqrt((error**2).mean()) < 0.004
    assert found.standard_error.max() <= 0.004
    z = error / np.maximum(found.standard_error[:, 0], 1e-4)
    assert 0.3 < np.sqrt((z**2).mean()) < 1.5
    assert np.abs(z).max() < 4


def test_rays_are_added_until_errors_are_small_and_smaller_where_all_rays_agree():
    sensors_m = np.array([[-2.0, 0.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    scene = Scene(of_kinds(wood=half_plane(4.0)))
    for tolerance in (4e-3, 1e-3, 5e-4):
        found = see(scene, sensors_m, UP, tolerance=tolerance)
        full, half, none = found.standard_error[:, 0]
        assert 0 < half <= tolerance
        assert 0 < full == none <= tolerance / 8
    finer = see(scene, sensors_m, UP, tolerance=1e-4).n_rays
    assert (finer > found.n_rays)[1].all()


def test_no_more_rays_than_allowed_are_traced():
    found = see(
        Scene(of_kinds(wood=half_plane(4.0))), SENSOR * 0, UP, tolerance=1e-9, max_rays=1000
    )
    assert found.n_rays[0, 0] == 1000 / len(found.share)


def test_a_wide_sensor_sees_part_of_the_sun_on_either_side_of_an_edge():
    found = see(
        Scene(of_kinds(wood=half_plane(1.0))),
        np.array([[0.25, 0.0, 0.0]]),
        UP,
        aperture_m=1.0,
        sun_diameter_deg=0.0,
    )
    assert found.share.mean() == pytest.approx(seen_beside_an_edge(0.5), abs=0.003)


def test_a_hardly_lit_sensor_is_not_said_to_be_dark_for_certain():
    place = np.array([[0.97 * 4.0 * np.sin(SUN_RADIUS), 0.0, 0.0]])
    found = see(Scene(of_kinds(leaf=half_plane(4.0))), place, UP, tolerance=0.1)
    assert 0 < found.standard_error[0, 0] < 0.1


N_SEEDS = 30


def thirty_seeds(scene, sensors_m, **settings):
    """Shares and stated errors (seed, sensor) under the sun overhead."""
    scene = traced.load(scene)
    settings = {
        "tolerance": 0.004,
        "max_rays": 1 << 14,
        "sun_diameter_deg": SUN_DIAMETER_DEG,
    } | settings
    found = [sunlit(scene, sensors_m, UP, seed=seed, **settings) for seed in range(N_SEEDS)]
    return (
        np.array([one.share.mean(axis=0)[:, 0] for one in found]),
        np.array([one.standard_error[:, 0] for one in found]),
    )


@pytest.mark.parametrize("bright", [True, False])
def test_errors_by_an_edge_have_a_spread_of_one_where_only_a_sliver_differs(bright):
    """Discs of which 0.05 to 5 % lie beyond an edge, on its light or on its dark side."""
    inside = np.linspace(0.7, 0.99, 40) * (1 if bright else -1)
    sensors_m = np.stack([inside * 4.0 * np.sin(SUN_RADIUS), 0 * inside, 0 * inside], axis=1)
    share, stated = thirty_seeds(Scene(of_kinds(leaf=half_plane(4.0))), sensors_m)
    z = (share - seen_beside_an_edge(inside)) / stated
    assert np.sqrt((z**2).mean()) == pytest.approx(1, abs=0.15)
    assert np.abs(z).max() < 5


def pinhole(part, height_m=4.0):
    """Opaque but for a square hole overhead through which this part of the sun's disc is seen."""
    half = 0.5 * height_m * np.sin(SUN_RADIUS) * np.sqrt(np.pi * part)
    inner = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    flat = np.concatenate([inner, inner / half * 50])
    corners = np.c_[flat, np.full(8, height_m)]
    sides = [((k, (k + 1) % 4, (k + 1) % 4 + 4), (k, (k + 1) % 4 + 4, k + 4)) for k in range(4)]
    return Mesh(corners, np.array(sides, np.int32).reshape(-1, 3), np.zeros(8, np.int32))


@pytest.mark.parametrize("part", [0.0005, 0.001, 0.002, 0.005, 0.01, 0.02])
def test_a_pinhole_in_front_of_the_sun_is_within_the_stated_error(part):
    """Whether rays meet the hole or not, no seed is further than 5 stated errors from the truth."""
    share, stated = thirty_seeds(Scene(of_kinds(leaf=pinhole(part))), np.zeros((1, 3)))
    z = (share - part) / stated
    assert np.abs(z).max() < 5
    assert np.sqrt((z**2).mean()) < 1.5
    assert np.sqrt((stated**2).mean()) < 0.004


def test_a_grid_and_a_leaf_together_stop_what_each_lets_through():
    layer = turbid_slab(1.0)
    found = see(Scene(of_kinds(leaf=half_plane(0.8)), layer), SENSOR, UP)
    assert found.share.mean() == pytest.approx(0.5 * np.exp(-0.5), abs=0.003)


def test_a_repeated_cell_stops_the_beam_like_the_endless_thing():
    """A roof with a slit of 1 m every 4 m: 3 m above ground, the sun at 45° across it."""
    roof = half_plane(3.0)
    roof = Mesh(roof.vertices_m * [3 / 50, 1, 1], roof.faces, roof.element)
    scene = traced.load(Scene(of_kinds(wood=roof)), cell_m=np.array([[0.0, 0.0], [4.0, 4.0]]))
    x = np.linspace(0.05, 3.95, 40)
    sensors_m = np.stack([x, 0 * x + 2.0, 0 * x], axis=1)
    found = sunlit(
        scene,
        sensors_m,
        directions([45.0, 80.0], [90.0, 270.0]),
        tolerance=0.01,
        max_rays=64,
        seed=1,
        sun_diameter_deg=0.0,
    ).share.mean(axis=0)
    lit = [(x + 3.0) % 4.0 > 3.0, (x - 3.0 * np.tan(np.radians(80.0))) % 4.0 > 3.0]
    assert (np.array(lit) == found.T).all()


def test_the_answer_depends_neither_on_threads_nor_on_blocks(monkeypatch):
    sensors_m = np.stack([np.linspace(-0.02, 0.02, 40), np.zeros(40), np.zeros(40)], axis=1)
    scene = Scene(of_kinds(leaf=half_plane(4.0)), turbid_slab(1.0))
    threads = dr.thread_count()
    try:
        found = []
        for n_threads, block in ((1, 1 << 20), (2, 1 << 20), (2, 1 << 11)):
            dr.set_thread_count(n_threads)
            monkeypatch.setattr(rays_to_sky, "RAYS_PER_KERNEL", block)
            found.append(see(scene, sensors_m, directions([0.0, 0.1])))
    finally:
        dr.set_thread_count(threads)
    for other in found[1:]:
        assert found[0].share.tobytes() == other.share.tobytes()
        assert found[0].standard_error.tobytes() == other.standard_error.tobytes()
