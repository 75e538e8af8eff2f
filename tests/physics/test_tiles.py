"""A wide scene cut into tiles gives the light of the whole one."""

import numpy as np
import pandas as pd
import pytest
from benchmarks import crown
from benchmarks import tiles as plots

from dapple.formats.meshes import Mesh, of_discs
from dapple.light.tiles import Tiling, by_tile, seen_from, triangles
from dapple.scene.surfaces import GROUND, Scene, Surface, of_kinds

SIDE_M = 30.0
TILING = Tiling(size_m=10.0, lowest_sun_deg=24.0, far_triangle_m=0.5)
WHOLE = Tiling(size_m=0.0, lowest_sun_deg=24.0, far_triangle_m=0.5)
"""The afternoon of the test has no sun below 25°, and the shadows are shorter than the plot."""
SENSORS = plots.sensors(SIDE_M, 8)


@pytest.fixture(scope="module")
def plot() -> Scene:
    return plots.plot(SIDE_M, 6000)


@pytest.fixture(scope="module")
def whole(plot):
    return plots.light(plot, SENSORS, WHOLE, seed=1)


@pytest.fixture(scope="module")
def tiled(plot):
    """The same rays start from the sensors: they differ where what they meet differs."""
    return plots.light(plot, SENSORS, TILING, seed=1)


def test_all_that_casts_shadow_into_a_tile_is_there_at_the_lowest_sun(whole, tiled):
    np.testing.assert_array_equal(whole.direct, tiled.direct)
    assert 0 < (whole.direct < 0.5 * whole.direct.max()).mean() < 1


def test_sky_light_of_tiles_is_that_of_the_plot(whole, tiled):
    assert abs(tiled.sky.mean() / whole.sky.mean() - 1) < 0.002
    assert np.abs(tiled.sky - whole.sky).max() < 0.01 * whole.sky.mean()


def test_scattered_light_of_tiles_is_that_of_the_plot(whole, tiled):
    """Of few paths: its standard error is some per cent of it, 0.4 % of all light."""
    assert abs(tiled.scattered.mean() - whole.scattered.mean()) < 0.1 * whole.scattered.mean()


def test_light_of_tiles_traced_with_other_rays_is_that_of_the_plot_within_its_error(plot, whole):
    others = plots.light(plot, SENSORS, TILING, seed=2)
    total = [part.direct + part.sky + part.scattered for part in (whole, others)]
    error = np.hypot(whole.standard_error, others.standard_error)
    z = (total[1] - total[0])[error > 0] / error[error > 0]
    assert abs(z.mean()) < 0.3
    assert z.std() < 1.3


def test_fewer_triangles_are_traced_for_a_tile(plot):
    """Those at the edge of the plot have most of their margin outside."""
    counts = plots.stored(plot, SENSORS, TILING)
    assert max(counts) <= triangles(plot)
    assert np.mean(counts) < 0.7 * triangles(plot)
    assert min(counts) < 0.55 * triangles(plot)


RING_M, TOP_M, LEAF_M = 10.0, 4.0, 0.12


def ring(n: int) -> Mesh:
    """Leaves by chance in a ring of 1 m that stands around the origin, with spherical angles."""
    rng = np.random.default_rng(1)
    angle = rng.uniform(0, 2 * np.pi, n)
    at = RING_M + rng.uniform(0, 1, n)
    centre = np.stack([at * np.cos(angle), at * np.sin(angle), rng.uniform(0, TOP_M, n)], axis=1)
    normal = rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return of_discs(np.column_stack([np.full(n, LEAF_M / 2), centre, normal]), n_sides=4)


def passing(area_m2: float) -> float:
    """Of the light of an even sky on a level plate within the ring, by the law of Beer."""
    height = np.radians(np.linspace(0, 90, 20_001)[1:-1])
    way_m = np.clip(TOP_M / np.tan(height) - RING_M, 0, 1) / np.cos(height)
    density = area_m2 / (np.pi * ((RING_M + 1) ** 2 - RING_M**2) * TOP_M)
    return float((np.sin(2 * height) * np.exp(-0.5 * density * way_m)).mean() * np.pi / 2)


AT_ORIGIN = pd.DataFrame({"sensor": ["s0"], "x_m": 0.0, "y_m": 0.0, "z_m": 0.0})
CLOSE = Tiling(size_m=1.0, lowest_sun_deg=60.0, far_triangle_m=0.5)
"""Its margin ends before the ring."""


def sky_share(mesh: Mesh, tiling: Tiling) -> float:
    """Light that the sensor has of an even sky, without a sun, over that without the mesh."""
    sky = crown.sky(1, 4)
    sky["sky_coefficients"] = 0.0 * sky["sky_coefficients"]
    found = plots.light(Scene(of_kinds(leaf=mesh)), AT_ORIGIN, tiling, seed=1, sky=sky)
    return float(found.sky.sum() / sky["diffuse_horizontal_umol_m2_s"].sum())


@pytest.mark.parametrize("n", [20_000, 200_000], ids=["thin", "closed"])
@pytest.mark.parametrize("tiling", [WHOLE, CLOSE], ids=["whole", "tile"])
def test_a_ring_beyond_the_margin_takes_of_the_low_sky_what_beers_law_says(n, tiling):
    """Of leaves by chance, the area tells how often a ray passes, not their size."""
    mesh = ring(n)
    low_sky = np.sin(np.arctan(TOP_M / RING_M)) ** 2
    assert 0.2 * low_sky < 1 - passing(mesh.area_m2) < low_sky
    assert sky_share(mesh, tiling) == pytest.approx(passing(mesh.area_m2), abs=0.01)


def test_longer_triangles_have_the_area_and_the_tilt_of_those_they_stand_for():
    mesh = ring(50_000)
    window_m = np.array([[-5.0, -5.0], [5.0, 5.0]])
    far = seen_from(Scene(of_kinds(leaf=mesh)), window_m, 0.5, seed=1).surfaces[0].mesh
    assert len(far.faces) < 0.1 * len(mesh.faces)
    assert far.area_m2 == pytest.approx(mesh.area_m2, rel=0.03)
    flat = [np.abs(one.triangle_normal[:, 2]).sum() / 2 for one in (mesh, far)]
    assert flat[1] == pytest.approx(flat[0], rel=0.04)
    edge_m = np.linalg.norm(np.diff(far.vertices_m[far.faces], axis=1), axis=2)
    assert edge_m.max() <= 0.5 + 1e-9


def test_long_triangles_and_terrain_and_plants_at_many_places_stay_whole():
    stem, leaves = crown.stem(), crown.leaves(2000)
    ground = Surface(leaves, GROUND, is_leaf=False)
    places = Surface(leaves, places_m=np.array([[100.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    scene = Scene((*of_kinds(wood=stem), ground, places))
    far_off_m = np.array([[500.0, 500.0], [510.0, 510.0]])
    seen = seen_from(scene, far_off_m, 0.5, seed=1)
    np.testing.assert_allclose(
        seen.surfaces[0].mesh.vertices_m[seen.surfaces[0].mesh.faces], stem.vertices_m[stem.faces]
    )
    assert seen.surfaces[1] is ground
    assert seen.surfaces[2] is places


def test_what_reaches_into_the_window_is_as_it_was_and_every_tile_sees_the_same_far_away():
    scene = Scene(of_kinds(leaf=ring(5000)))
    everything = np.array([[-30.0, -30.0], [30.0, 30.0]])
    kept = seen_from(scene, everything, 0.5, seed=1).surfaces[0].mesh
    mesh = scene.surfaces[0].mesh
    np.testing.assert_array_equal(kept.vertices_m[kept.faces], mesh.vertices_m[mesh.faces])
    assert kept.n_elements == mesh.n_elements
    east, west = (
        seen_from(scene, at + np.array([[-1.0, -1.0], [1.0, 1.0]]), 0.5, seed=1).surfaces[0].mesh
        for at in ([3.0, 0.0], [-3.0, 0.0])
    )
    np.testing.assert_array_equal(east.vertices_m, west.vertices_m)


def test_sensors_of_many_tiles_come_back_in_their_order(plot):
    class Seen(list):
        def of(self, numbers):
            return Seen(self[k] for k in numbers)

        @classmethod
        def joined(cls, parts):
            return cls(label for part in parts for label in part)

    back = by_tile(plot, SENSORS, TILING, 1, lambda part, some: Seen(some["sensor"]))
    assert back == list(SENSORS["sensor"])
