"""Scenes of several species, each with its own optics, in one place or in many."""

import numpy as np
import pytest
from tests.physics.slab import turbid_slab

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.light import brf, tensor, transport
from dapple.light.timestep import Rays, timestep
from dapple.scene import mitsuba_scene, traced
from dapple.scene.counters import Counters
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, Surface
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

SENSORS = np.array([[0.0, 0.0, 0.3], [0.9, -0.4, 0.3]])
APPLE_PLACES = np.array([[-0.6, 0.0, 0.0], [0.8, 0.5, 0.2], [0.1, -0.9, 0.1]])
GRASS_PLACES = np.array([[0.0, 0.4, -0.4], [-0.5, -0.5, -0.5]])


def squares(n, edge_m, low, high, seed):
    """Squares of random position and tilt in a box."""
    rng = np.random.default_rng(seed)
    centre, normal = rng.uniform(low, high, (n, 3)), rng.normal(size=(n, 3))
    along = np.cross(normal, rng.normal(size=(n, 3)))
    across = np.cross(normal, along)
    along, across = (
        0.5 * edge_m * v / np.linalg.norm(v, axis=1, keepdims=True) for v in (along, across)
    )
    corners = np.stack([centre + a * along + b * across for a, b in SIGNS], axis=1)
    faces = 4 * np.arange(n)[:, None] + np.array([0, 1, 2, 0, 2, 3])
    return Mesh(
        corners.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n, dtype=np.int32), 2),
    )


SIGNS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def two_species(**more):
    """Three apple trees of leaves and wood, two tufts of grass, and stones that stand alone."""
    leaves = squares(60, 0.2, (-0.4, -0.4, 0.9), (0.4, 0.4, 1.6), seed=1)
    wood = squares(20, 0.15, (-0.2, -0.2, 0.4), (0.2, 0.2, 1.2), seed=2)
    grass = squares(40, 0.15, (-0.3, -0.3, 0.8), (0.3, 0.3, 1.4), seed=3)
    stones = squares(5, 0.2, (0.2, 0.2, 0.4), (0.6, 0.6, 0.8), seed=4)
    surfaces = [
        Surface(leaves, "apple", places_m=APPLE_PLACES),
        Surface(wood, "wood", is_leaf=False, places_m=APPLE_PLACES),
        Surface(grass, "grass", places_m=GRASS_PLACES),
        Surface(stones, "stone", is_leaf=False),
    ]
    return Scene(surfaces, **more)


def optics(apple, grass, wood, stone, ground):
    """Of one band: reflectance and transmittance of leaves, reflectance of the rest."""
    reflected = {"apple": apple[0], "grass": grass[0], "wood": wood, "stone": stone}
    reflected["ground"] = ground
    passed = {"apple": apple[1], "grass": grass[1]}
    one = [
        {name: np.array([value]) for name, value in part.items()} for part in (reflected, passed)
    ]
    return Optics(np.array([550.0]), *one)


LOSSLESS = optics((0.7, 0.3), (0.2, 0.8), 1.0, 1.0, 1.0)
GREEN = optics((0.3, 0.1), (0.1, 0.6), 0.5, 0.9, 0.2)


def by_transport(scene, leaf, **more):
    """Mean and standard error (sensors,) under a sky of radiance 1."""
    settings = {"n_paths": 40_000, "n_patches": 145, "max_orders": 200, "seed": 1} | more
    counted = transport.collect(traced.load(scene), SENSORS, **settings)
    sky = np.ones((1, 145))
    light = tensor.straight(counted, sky)[..., 0] + tensor.scattered(counted, sky, leaf)[..., 0, 0]
    return light.mean(axis=1), light.std(axis=1, ddof=1) / np.sqrt(light.shape[1])


def by_timestep(scene, leaf):
    """As `by_transport`, by Mitsuba's integrators."""
    found = timestep(
        mitsuba_scene.build(scene, leaf),
        SENSORS,
        sun_zenith_deg=100.0,
        sun_azimuth_deg=0.0,
        beam_normal=np.zeros(1),
        diffuse_horizontal=np.array([np.pi]),
        sky=lambda zenith, azimuth: np.ones_like(zenith),
        sun_diameter_deg=SUN_DIAMETER_DEG,
        rays=Rays(16, 1, 1024, 1024, max_depth=200, roulette_depth=20),
        seed=1,
    )
    return found["total"][:, 0], found["standard_error"][:, 0]


@pytest.mark.parametrize("engine", [by_transport, by_timestep])
def test_two_species_and_two_kinds_of_plants_in_many_places_lose_no_light(engine):
    """Where nothing absorbs, a sensor in an even sky gets pi, whatever stands around it."""
    mean, error = engine(two_species(), LOSSLESS)
    assert (error > 0).all()
    assert mean == pytest.approx(np.pi, abs=4 * error.max())
    assert error.max() < 0.01 * np.pi


def test_with_voxels_of_a_third_species_nothing_is_lost_either():
    scene = two_species(voxels=turbid_slab(0.5), voxel_optics="apple")
    mean, error = by_transport(scene, LOSSLESS)
    assert mean == pytest.approx(np.pi, abs=4 * error.max())


def test_both_engines_see_the_same_species():
    (one, error), (other, its_error) = (
        f(two_species(), GREEN) for f in (by_transport, by_timestep)
    )
    assert one == pytest.approx(other, abs=4 * np.hypot(error, its_error).max())
    swapped = optics((0.1, 0.6), (0.3, 0.1), 0.5, 0.9, 0.2)
    assert np.abs(by_transport(two_species(), swapped)[0] - one).max() > 5 * error.max()


def faces(surface):
    """Windows on both faces of the squares of a surface, in all of its places."""
    square = surface.mesh.vertices_m.reshape(-1, 4, 3)
    places = np.zeros((1, 3)) if surface.places_m is None else surface.places_m
    along, across = square[:, 1] - square[:, 0], square[:, 3] - square[:, 0]
    normal = np.cross(along, across)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sides = [
        (square[:, 0] + place + 1e-4 * side * normal, along, across, side * normal)
        for place in places
        for side in (1, -1)
    ]
    return brf.Views(*(np.concatenate(part) for part in zip(*sides, strict=True)), cosine=True)


def test_what_two_species_ground_and_sky_get_is_what_the_sky_gives():
    """Of light on both faces of every leaf and of wood, and on ground, a share is absorbed."""
    scene = two_species()
    loaded = traced.load(scene, cell_m=np.array([[-2.0, -2.0], [2.0, 2.0]]))

    def share(views, n_paths):
        """Of the light that the sky sends into the cell, what gets through windows."""
        area = np.linalg.norm(np.cross(views.edge_a_m, views.edge_b_m), axis=1) / 16.0
        settings = {"n_paths": n_paths, "max_orders": 100, "seed": 1}
        received = brf.collect(loaded, views, np.array([0.0, 0.0, 1.0]), **settings)
        flux, error = brf.reflectance_factor(received, GREEN, diffuse_share=1.0)
        return np.array([area @ flux[:, 0], np.linalg.norm(area * error[:, 0])])

    def through_the_cell(height_m, up):
        axis = np.array([[0.0, 0.0, up]])
        return share(brf.over_cell(loaded, axis, height_m=height_m, cosine=True), 60_000)

    budget = {"sky": through_the_cell(5.0, -1.0)}
    budget["ground"] = (1 - GREEN.reflectance_of("ground")) * through_the_cell(1e-4, 1.0)
    for surface in scene.filled:
        name = surface.optics
        sent_on = GREEN.albedo(name) if surface.is_leaf else GREEN.reflectance_of(name)
        budget[name] = (1 - sent_on) * share(faces(surface), 128)
    found, error = np.array(list(budget.values())).T
    assert list(budget) == ["sky", "ground", "apple", "wood", "grass", "stone"]
    assert (found > 4 * error).all()
    assert found.sum() == pytest.approx(1.0, abs=3 * np.linalg.norm(error))
    assert np.linalg.norm(error) < 0.003


def test_under_two_endless_leaves_each_lets_its_own_light_through():
    """Half the sky is behind each; a point of a leaf gets pi and sends τ of it down evenly."""
    far = 5000.0
    halves = [
        Mesh(
            np.array([(x[0], -far, 1), (x[1], -far, 1), (x[1], far, 1), (x[0], far, 1)], float),
            np.array([[0, 1, 2], [0, 2, 3]], np.int32),
            np.zeros(2, np.int32),
        )
        for x in ((-far, 0.0), (0.0, far))
    ]
    scene = Scene([Surface(halves[0], "apple"), Surface(halves[1], "grass")])
    leaf = optics((0.3, 0.1), (0.1, 0.6), 0.0, 0.0, 0.0)
    mean, error = by_transport(scene, leaf)
    assert mean[0] == pytest.approx(np.pi * (0.1 + 0.6) / 2, abs=4 * error[0])


def test_counts_of_many_kinds_pack_into_one_number_and_keep_their_order():
    rng = np.random.default_rng(1)
    for leaves, opaque in ((1, 2), (2, 3), (4, 5)):
        names = [f"s{k}" for k in range(leaves + opaque)]
        counters = Counters(tuple(names[:leaves]), tuple(names[leaves:]))
        counts = rng.integers(0, 1 << counters.bits, (500, len(counters))).astype(np.uint8)
        packed = counters.packed(counts)
        assert packed.dtype == counters.word
        np.testing.assert_array_equal(counters.unpacked(packed), counts)
        order = np.lexsort(counts.T)
        assert (np.diff(packed[order].astype(float)) >= 0).all()


def test_paths_longer_than_a_counter_can_tell_are_refused():
    few, many = Counters(("leaf",), ("wood", "ground")), Counters(tuple("abcdef"), ("ground",))
    few.check(255)
    many.check(15)
    with pytest.raises(InputError, match="6 kinds of leaves"):
        many.check(32)


def test_a_surface_without_optics_is_named():
    scene = Scene([Surface(squares(2, 0.1, (0, 0, 1), (1, 1, 2), 1), "oak")])
    with pytest.raises(InputError, match="no reflectance of `oak`, only of apple"):
        by_transport(scene, GREEN, n_paths=64)


def test_one_name_for_leaves_and_stones_is_an_error():
    mesh = squares(2, 0.1, (0, 0, 1), (1, 1, 2), 1)
    with pytest.raises(InputError, match="`apple` of leaves and of an opaque surface"):
        traced.load(Scene([Surface(mesh, "apple"), Surface(mesh, "apple", is_leaf=False)]))
