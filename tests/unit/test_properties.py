"""What holds for whatever is given: drawn by Hypothesis, the same examples each time."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from tests.unit import test_bounds as bounds

from dapple.config.settings import validate
from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots, select
from dapple.light import transport, visibility
from dapple.scene import traced
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky import sky_radiance
from dapple.structure.polygons import reconstruct
from dapple.structure.voxel_sums import Grid, accumulate
from dapple.structure.voxels import plant_area_density

COMMON = {
    "derandomize": True,
    "database": None,
    "deadline": None,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.filter_too_much],
}
SEEDS = st.integers(0, 2**32 - 1)
ANGLES = st.floats(0, 360)


def turned(xyz, degrees):
    """Turned about the vertical, clockwise from above as azimuths are."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray(xyz) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


# Polygons


@st.composite
def points_of_a_voxel(draw):
    """Three points or more in one voxel of 10 cm: flat, round, on a line, or in clumps."""
    rng = np.random.default_rng(draw(SEEDS))
    spread = [draw(st.sampled_from([0.0, 1e-6, 1e-3, 1.0])) for _ in range(3)]
    points = rng.uniform(-0.049, 0.049, (draw(st.integers(3, 60)), 3)) * spread
    if draw(st.booleans()):
        points = np.round(points, 3)  # many in one place, many on one line
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.clip(points @ turn, -0.0499, 0.0499) + 0.05


def corners_of(mesh):
    """Corners (c, 3) of the only polygon, in order."""
    return mesh.vertices_m[np.concatenate([mesh.faces[0, :2], mesh.faces[:, 2]])]


@given(points_of_a_voxel(), st.sampled_from([0.0, 0.002, 0.01]))
@settings(max_examples=60, **COMMON)
def test_polygons_lie_in_their_plane_are_convex_and_cover_their_points(points_m, buffer_m):
    mesh = reconstruct(points_m, voxel_size_m=0.1, buffer_m=buffer_m, seed=1)
    corners = corners_of(mesh)
    normal = np.linalg.svd(corners - corners.mean(axis=0))[2][2]
    assert np.abs((corners - corners.mean(axis=0)) @ normal).max() < 1e-9
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(edges, np.roll(edges, -1, axis=0)) @ normal
    assert (turns > -1e-12).all() or (turns < 1e-12).all()
    rises = np.linalg.svd(points_m - points_m.mean(axis=0), compute_uv=False)
    if rises[1] < 1e-5:  # a line or one place, of which a chance outline stands for the rest
        return
    inwards = np.cross(normal, edges) * np.sign(turns.sum())
    depth = np.einsum("ci,pci->pc", inwards, points_m[:, None] - corners[None])
    assert (depth >= -1e-8 * np.linalg.norm(edges, axis=1)).all()


# Shots through voxels


def shots(rng, n, kept=0.6):
    """Shots from around a grid, some with echoes."""
    origin = rng.uniform(-3, 3, (n, 3))
    direction = rng.uniform(-1, 1, (n, 3)) - origin
    way = np.linalg.norm(direction, axis=1)
    has = rng.random(n) < kept
    blank = np.zeros(has.sum(), np.float32)
    return Shots(
        origin,
        direction / way[:, None],
        np.zeros(n, np.uint16),
        np.concatenate([[0], np.cumsum(has)]).astype(np.int64),
        (way * rng.uniform(0.7, 1.3, n))[has],
        blank,
        blank,
        np.zeros(3),
    )


@given(SEEDS, st.sampled_from([0.1, 0.37, 1.0]), st.tuples(*3 * [st.integers(1, 9)]))
@settings(max_examples=60, **COMMON)
def test_chords_in_voxels_add_up_to_the_chord_through_the_grid(seed, size_m, shape):
    rng = np.random.default_rng(seed)
    grid = Grid(rng.uniform(-1, 0, 3), shape, size_m)
    one = shots(rng, 1, kept=0.0)
    low, high = grid.corner_m, grid.corner_m + size_m * np.array(shape)
    with np.errstate(divide="ignore"):
        a, b = ((side - one.origin_m[0]) / one.direction[0] for side in (low, high))
    chord = max(0.0, np.maximum(a, b).min() - max(0.0, np.minimum(a, b).max()))
    found = accumulate(one, grid).visits[:, 1].sum()
    assert found == pytest.approx(chord, rel=1e-9, abs=1e-9)


@given(SEEDS, st.integers(1, 9))
@settings(max_examples=8, **COMMON)
def test_plant_area_knows_neither_the_order_of_shots_nor_how_they_are_split(seed, n_parts):
    rng = np.random.default_rng(seed)
    grid, some = Grid(np.full(3, -1.0), (4, 4, 4), 0.5), shots(rng, 400)
    name = "plant_area_density_m2_m3"
    whole = plant_area_density(some, grid)[name]
    order = rng.permutation(400)
    parts = [select(some, np.isin(np.arange(400), p)) for p in np.array_split(order, n_parts)]
    split = plant_area_density(parts, grid)[name]
    np.testing.assert_allclose(split, whole, rtol=1e-9)


# Light


def leaves(rng, n=40):
    """Square leaves above the origin."""
    centre = rng.uniform([-1, -1, 1], [1, 1, 2], (n, 3))
    u, v = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0][:, :2].swapaxes(0, 1)
    corners = [centre + 0.15 * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = np.arange(n)[:, None] * 4 + np.array([[0, 1, 2, 0, 2, 3]])
    element = np.repeat(np.arange(n, dtype=np.int32), 2)
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    return Mesh(vertices, faces.reshape(-1, 3).astype(np.int32), element)


@given(SEEDS)
@settings(max_examples=6, **COMMON)
def test_the_transport_tensor_knows_no_order_of_sensors(seed):
    rng = np.random.default_rng(seed)
    scene = traced.load(Scene(of_kinds(leaf=leaves(rng))))
    place, keys = rng.uniform(-1, 1, (5, 3)) * [1, 1, 0], np.arange(5, dtype=np.uint32)
    order = rng.permutation(5)
    settings = {"n_paths": 64, "n_patches": 145, "max_orders": 5, "seed": 3}
    given = transport.collect(scene, place, keys=keys, **settings)
    other = transport.collect(scene, place[order], keys=keys[order], **settings)
    np.testing.assert_array_equal(other.sky_seen, given.sky_seen[order])
    np.testing.assert_array_equal(other.cut, given.cut[order])

    def kinds(found, number_of):
        columns = [number_of[found.sensor], found.replicate, found.patch, *found.orders.T]
        table = pd.DataFrame(np.column_stack([*columns, found.count]))
        return table.sort_values(list(table.columns)).to_numpy()

    np.testing.assert_array_equal(kinds(given, np.arange(5)), kinds(other, order))


@given(SEEDS, ANGLES, st.floats(1, 80), ANGLES)
@settings(max_examples=12, **COMMON)
def test_a_scene_turned_with_its_sun_has_the_same_shade(seed, turn_deg, zenith_deg, azimuth_deg):
    rng = np.random.default_rng(seed)
    mesh, place = leaves(rng), rng.uniform(-1, 1, (20, 3)) * [1, 1, 0]
    zenith, azimuth = np.radians(zenith_deg), np.radians(azimuth_deg)
    sun = np.array([[np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth),
                     np.cos(zenith)]])  # fmt: skip

    def shade(degrees):
        around = Mesh(turned(mesh.vertices_m, degrees), mesh.faces, mesh.element)
        return visibility.sunlit(
            traced.load(Scene(of_kinds(leaf=around))),
            turned(place, degrees),
            turned(sun, degrees),
            tolerance=0.1,
            max_rays=64,
            seed=1,
            sun_diameter_deg=0.0,
        ).share.mean(axis=(0, 2))

    np.testing.assert_array_equal(shade(turn_deg), shade(0.0))


@given(
    st.sampled_from(["isotropic", "cie_clear", "cie_overcast", "perez"]),
    ANGLES, st.floats(0, 89), ANGLES, st.floats(0, 89), ANGLES,
)  # fmt: skip
@settings(max_examples=60, **COMMON)
def test_a_sky_turned_with_its_sun_is_the_same_sky(
    model, turn_deg, sun_zenith_deg, sun_azimuth_deg, zenith_deg, azimuth_deg
):
    def radiance(degrees):
        sky = xr.Dataset(
            {
                "sun_zenith_deg": ("time", [sun_zenith_deg]),
                "sun_azimuth_deg": ("time", [(sun_azimuth_deg + degrees) % 360]),
                "sky_coefficients": (("time", "coefficient"), [[-1.0, -0.3, 10.0, -3.0, 0.45]]),
            },
            attrs={"sky_model": model},
        )
        where = np.array([zenith_deg]), np.array([(azimuth_deg + degrees) % 360])
        return sky_radiance.in_directions(sky, *where)

    np.testing.assert_allclose(radiance(turn_deg), radiance(0.0), rtol=1e-6)


# The configuration


NUMBERS = {name: bounds.numeric(key)[0] for name, key in bounds.every_key()
           if bounds.numeric(key) and isinstance(key.get("default"), int | float)}  # fmt: skip
DEFAULTS = {name: key["default"] for name, key in bounds.every_key() if name in NUMBERS}


@given(st.dictionaries(st.sampled_from(sorted(NUMBERS)), st.floats(0.5, 2.0), max_size=6))
@settings(max_examples=15, **COMMON)
def test_a_configuration_comes_back_from_its_file_as_it_went(factors):
    config = {}
    for name, factor in factors.items():
        value = DEFAULTS[name] * factor
        *sections, last = name.split(".")
        inner = config
        for section in sections:
            inner = inner.setdefault(section, {})
        inner[last] = round(value) if NUMBERS[name]["type"] == "integer" else value
    try:
        written = validate(config)
    except InputError:
        assume(False)
    read = validate(yaml.safe_load(yaml.safe_dump(written.model_dump(mode="json"))))
    assert read == written
