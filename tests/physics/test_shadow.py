"""Shadow rays against closed forms: edges, discs, slabs, single voxels."""

import numpy as np
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.light import rays_to_sky
from dapple.light.rays_to_sky import Tracer
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

UP = np.array([[0.0, 0.0, 1.0]])


def rectangle(x, y, z):
    corners = [(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)]
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Mesh(np.array(corners, dtype=float), faces, np.zeros(2, dtype=np.int32))


def disc(radius, z, n=720):
    angle = np.arange(n) * 2.0 * np.pi / n
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, z)])
    faces = np.column_stack([np.zeros(n), 1 + np.arange(n), 1 + (np.arange(n) + 1) % n])
    vertices = np.concatenate([[[0.0, 0.0, z]], rim])
    return Mesh(vertices, faces.astype(np.int32), np.zeros(n, dtype=np.int32))


def voxels(density, size=1.0, low=(0.0, 0.0, 0.0), **attributes):
    centres = {
        name: low[k] + size * (np.arange(density.shape[k]) + 0.5) for k, name in enumerate("xyz")
    }
    return xr.Dataset(
        {"plant_area_density_m2_m3": (tuple("xyz"), density)},
        coords=centres,
        attrs={"voxel_size_m": size, **attributes},
    )


def directions(zenith_deg, azimuth_deg=0.0):
    z, a = np.broadcast_arrays(np.radians(zenith_deg), np.radians(azimuth_deg))
    return np.stack([np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)], axis=-1)


def sun_visibility(scene, points_m, ways, **more):
    return Tracer(scene).sun_visibility(
        points_m, ways, **{"sun_diameter_deg": SUN_DIAMETER_DEG, **more}
    )


def sky_visibility(scene, points_m, **more):
    return Tracer(scene).sky_visibility(points_m, **more)


def test_an_open_place_sees_all_of_the_sun_and_none_after_sunset():
    seen = sun_visibility(
        Scene(), np.zeros((3, 3)), directions([0.0, 89.0, 91.0]), n_disc=8, seed=1
    )
    assert (seen == [1.0, 1.0, 0.0]).all()


def test_the_penumbra_of_an_edge_is_the_part_of_the_disc_beside_it():
    height, radius = 4.0, 4.0 * np.tan(np.radians(0.5 * SUN_DIAMETER_DEG))
    scene = Scene(of_kinds(leaf=rectangle((0.0, 50.0), (-50.0, 50.0), height)))
    edge = np.linspace(-1.2, 1.2, 13)  # distance into the shade in radii of the sun
    points = np.column_stack([edge * radius, np.zeros(13), np.zeros(13)])
    s = np.clip(edge, -1.0, 1.0)
    expected = (np.arccos(s) - s * np.sqrt(1.0 - s * s)) / np.pi
    seen = sun_visibility(scene, points, UP, n_disc=4096, seed=2)[:, 0]
    assert seen == pytest.approx(expected, abs=0.005)


def test_a_wide_entrance_softens_an_edge():
    scene = Scene(of_kinds(wood=rectangle((0.0, 50.0), (-50.0, 50.0), 1.0)))
    points = np.array([[0.25, 0.0, 0.0]])
    seen = sun_visibility(scene, points, UP, n_disc=4096, seed=2, aperture_m=1.0)[0, 0]
    expected = (np.arccos(0.5) - 0.5 * np.sqrt(0.75)) / np.pi
    assert seen == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("leaf_area_index", [0.1, 2.0, 6.0])
def test_a_turbid_layer_transmits_by_its_slant_depth(leaf_area_index):
    layer = voxels(np.full((80, 80, 2), leaf_area_index / 2.0), low=(-40.0, -40.0, 3.0))
    zenith = np.array([0.0, 30.0, 60.0, 75.0])
    seen = sun_visibility(
        Scene(voxels=layer),
        np.zeros((1, 3)),
        directions(zenith, 137.0),
        n_disc=16,
        seed=3,
        sun_diameter_deg=0.0,
    )[0]
    expected = np.exp(-0.5 * leaf_area_index / np.cos(np.radians(zenith)))
    assert seen == pytest.approx(expected, rel=2e-4)


def test_every_voxel_stands_where_its_coordinates_say():
    rng = np.random.default_rng(4)
    density = rng.random((5, 3, 4)) * (rng.random((5, 3, 4)) < 0.6)
    density[rng.random((5, 3, 4)) < 0.1] = np.nan
    low, size = np.array([-1.3, 0.7, 2.0]), 0.4
    scene = Scene(voxels=voxels(density, size, low))
    way = directions([20.0, 55.0, 10.0, 0.0], [40.0, 250.0, 135.0, 0.0])
    points = low + rng.random((60, 3)) * [2.0, 1.2, 1.6] - [0.0, 0.0, 1.0]
    seen = sun_visibility(scene, points, way, n_disc=1, seed=5, sun_diameter_deg=0.0)
    t = (np.arange(8000) + 0.5) * 5.0 / 8000
    for i, point in enumerate(points):
        for j, d in enumerate(way):
            cell = np.floor((point + t[:, None] * d - low) / size).astype(int)
            inside = ((cell >= 0) & (cell < density.shape)).all(axis=1)
            depth = np.nansum(density[tuple(cell[inside].T)]) * 5.0 / 8000
            assert seen[i, j] == pytest.approx(np.exp(-0.5 * depth), abs=2e-3)


@pytest.mark.parametrize("radius", [0.3, 1.0, 4.0])
def test_a_disc_overhead_hides_its_cosine_weighted_share_of_the_sky(radius):
    scene = Scene(of_kinds(leaf=disc(radius, 1.0)))
    seen = sky_visibility(scene, np.zeros((1, 3)), n=4096, seed=6)[0]
    assert seen == pytest.approx(1.0 / (1.0 + radius**2), abs=0.004)


def test_the_answer_does_not_depend_on_how_rays_are_dealt_to_kernels(monkeypatch):
    scene = Scene(
        of_kinds(leaf=disc(0.5, 1.0)), voxels(np.full((2, 2, 2), 0.7), low=(-1.0, -1.0, 2.0))
    )
    points = np.random.default_rng(7).uniform(-1.0, 1.0, (7, 3)) * [1.0, 1.0, 0.0]
    way = directions(np.linspace(0.0, 60.0, 5), 20.0)
    whole = sun_visibility(scene, points, way, n_disc=8, seed=8)
    monkeypatch.setattr(rays_to_sky, "RAYS_PER_KERNEL", 50)
    assert (sun_visibility(scene, points, way, n_disc=8, seed=8) == whole).all()


def test_leaf_angles_that_are_not_known_are_refused():
    scene = Scene(voxels=voxels(np.ones((1, 1, 1)), leaf_angle_distribution="wavy"))
    with pytest.raises(InputError, match="wavy"):
        sky_visibility(scene, np.zeros((1, 3)), n=4, seed=9)
