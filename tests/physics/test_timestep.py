"""Mitsuba's path tracers at sensors against closed forms: open sky, shade, furnaces, slabs."""

import numpy as np
import pytest
import xarray as xr
from scipy.special import expn

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.light.rays_to_sky import Tracer
from dapple.light.timestep import Rays, timestep
from dapple.scene import mitsuba_scene, render_scene
from dapple.scene.phase import phase_function
from dapple.scene.scene_optics import Optics, group_bands, group_flux
from dapple.scene.surfaces import Scene, Surface, of_kinds
from dapple.sky.conditions import Ways
from dapple.sky.models import perez
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

BEAM, DIFFUSE = np.array([500.0, 600.0, 700.0]), np.array([90.0, 80.0, 70.0])
ORIGIN = np.zeros((1, 3))


def rays(**more):
    settings = {"replicates": 16, "direct": 128, "sky": 128, "scattered": 64, "max_depth": 8}
    return Rays(**settings | more)


def optics(rho=0.0, tau=0.0, bark=0.0, ground=0.0, n=3):
    values = (np.broadcast_to(np.asarray(v, float), n).copy() for v in (rho, tau, bark, ground))
    return Optics.of_tree(np.linspace(450.0, 650.0, n), *values)


def even(zenith_deg, azimuth_deg):
    return np.ones_like(zenith_deg)


def clear(zenith_deg, azimuth_deg):
    """Bright around a sun at 50° in azimuth 110°."""
    ways = Ways.under(50.0, 110.0, zenith_deg, azimuth_deg)
    return perez.radiance(np.array([-1.0, -0.3, 10.0, -3.0, 0.45]), ways)


def light(scene, sensors=ORIGIN, *, zenith=30.0, azimuth=0.0, beam=BEAM, diffuse=DIFFUSE, **more):
    options = {"sky": even, "rays": rays(), "seed": 1}
    options |= {"sun_diameter_deg": SUN_DIAMETER_DEG, **more}
    return timestep(
        scene,
        sensors,
        sun_zenith_deg=zenith,
        sun_azimuth_deg=azimuth,
        beam_normal=beam,
        diffuse_horizontal=diffuse,
        **options,
    )


def quad(corners):
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Mesh(np.array(corners, dtype=float), faces, np.zeros(2, dtype=np.int32))


def level(x, y, z):
    return quad([(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)])


def disc(radius, z, n=720):
    angle = np.arange(n) * 2.0 * np.pi / n
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, z)])
    faces = np.column_stack([np.zeros(n), 1 + np.arange(n), 1 + (np.arange(n) + 1) % n])
    vertices = np.concatenate([[[0.0, 0.0, z]], rim])
    return Mesh(vertices, faces.astype(np.int32), np.zeros(n, dtype=np.int32))


def leaves(n, size, low, high, seed):
    """Square leaves with spherical angles, in a box."""
    rng = np.random.default_rng(seed)
    centre = rng.uniform(low, high, (n, 3))
    u, v = rng.normal(size=(2, n, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(u, v)
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    corners = [
        centre + 0.5 * size * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    faces = np.arange(n)[:, None] * 4 + np.array([[0, 1, 2, 0, 2, 3]])
    return Mesh(
        np.stack(corners, axis=1).reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n, dtype=np.int32), 2),
    )


def voxels(density, size=1.0, low=(0.0, 0.0, 0.0), **attributes):
    centres = {
        name: low[k] + size * (np.arange(density.shape[k]) + 0.5) for k, name in enumerate("xyz")
    }
    return xr.Dataset(
        {"plant_area_density_m2_m3": (tuple("xyz"), density)},
        coords=centres,
        attrs={"voxel_size_m": size, **attributes},
    )


def slab(leaf_area_index):
    """A turbid layer, 1 m thick and 200 m wide, 2 m above the ground."""
    return voxels(np.full((200, 200, 1), leaf_area_index), 1.0, (-100.0, -100.0, 2.0))


def test_the_open_sky_gives_beam_and_diffuse_light():
    scene = mitsuba_scene.build(Scene(), optics(ground=0.3))
    sensors = np.array([[0.0, 0.0, 0.0], [9.0, -7.0, 2.0]])
    for zenith, azimuth in ((0.0, 0.0), (42.0, 200.0), (80.0, 310.0)):
        found = light(scene, sensors, zenith=zenith, azimuth=azimuth)
        cosine = np.cos(np.radians(zenith))
        assert found["direct"] == pytest.approx(np.stack([BEAM * cosine] * 2), rel=1.5e-3)
        assert found["sky"] == pytest.approx(np.stack([DIFFUSE] * 2), rel=1e-5)
        assert (found["scattered"] == 0.0).all()
        assert found["par"] == pytest.approx(found["total"].sum(axis=1))


def test_an_uneven_sky_gives_the_same_diffuse_light_on_the_level():
    scene = mitsuba_scene.build(Scene(), optics())
    found = light(scene, zenith=50.0, azimuth=110.0, sky=clear, rays=rays(sky=4096))
    assert found["sky"][0] == pytest.approx(DIFFUSE, rel=2e-3)


def test_the_sky_map_carries_the_irradiance_of_the_radiance_function():
    sky = render_scene.sky_map(clear, (181, 360))
    sine = np.sqrt((np.arange(1000) + 0.5) / 1000)  # even in cosine-weighted solid angle
    zenith, azimuth = np.degrees(np.arcsin(sine)), 0.36 * (np.arange(1000) + 0.5)
    irradiance = np.pi * clear(zenith[:, None], azimuth).mean()
    assert sky[30, 100] / clear(30.0, 100.5) == pytest.approx(1.0 / irradiance, rel=2e-3)


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 180.0, 270.0])
def test_a_wall_shades_from_the_side_on_which_it_stands(azimuth):
    angle = np.radians(azimuth)
    out, along = np.array([np.sin(angle), np.cos(angle), 0.0]), np.array([0.0, 0.0, 100.0])
    side = 100.0 * np.array([np.cos(angle), -np.sin(angle), 0.0])
    wall = quad([0.01 * out + s * side + t * along for s, t in ((-1, 0), (1, 0), (1, 1), (-1, 1))])
    scene = mitsuba_scene.build(Scene(of_kinds(wood=wall)), optics(bark=0.5))

    def sky(z, a):
        """Brighter by 60 % of the direction's eastward and 30 % of its northward part."""
        z, a = np.radians(z), np.radians(a)
        return 1.0 + np.sin(z) * (0.6 * np.sin(a) + 0.3 * np.cos(a))

    behind = light(scene, azimuth=azimuth, sky=sky, rays=rays(sky=1024))
    assert (behind["direct"] == 0.0).all()
    visible = 0.5 - (2.0 / 3.0) / np.pi * (0.6 * out[0] + 0.3 * out[1])
    assert behind["sky"][0] == pytest.approx(visible * DIFFUSE, rel=5e-3)

    bright = rays(scattered=1024)
    before = light(scene, azimuth=azimuth + 180.0, diffuse=0.0 * DIFFUSE, rays=bright)
    assert before["direct"][0] == pytest.approx(BEAM * np.cos(np.radians(30.0)), rel=1e-3)
    # half of what the sensor sees is a wall that reflects half of the beam
    assert before["scattered"][0] == pytest.approx(0.25 * BEAM * np.sin(np.radians(30.0)), rel=0.03)


@pytest.mark.parametrize("radius", [0.5, 2.0])
def test_a_black_disc_overhead_hides_its_share_of_the_sky(radius):
    scene = mitsuba_scene.build(Scene(of_kinds(leaf=disc(radius, 1.0))), optics())
    found = light(scene, zenith=0.0, rays=rays(sky=2048))
    assert found["sky"][0] == pytest.approx(DIFFUSE / (1.0 + radius**2), rel=5e-3)
    assert (found["direct"] == 0.0).all()


def test_a_sun_of_no_diameter_is_a_point():
    half = Scene(of_kinds(leaf=level((0.0, 50.0), (-50.0, 50.0), 4.0)))
    sensors = np.array([[-0.002, 0.0, 0.0], [0.002, 0.0, 0.0]])
    found = light(mitsuba_scene.build(half, optics()), sensors, zenith=0.0, sun_diameter_deg=0.0)
    assert found["direct"] == pytest.approx(np.stack([BEAM, 0.0 * BEAM]), rel=1e-3)


def test_the_sun_is_a_disc_with_a_penumbra():
    radius = 4.0 * np.tan(np.radians(0.5 * SUN_DIAMETER_DEG))
    scene = mitsuba_scene.build(
        Scene(of_kinds(leaf=level((0.0, 50.0), (-50.0, 50.0), 4.0))), optics()
    )
    edge = np.array([-1.1, -0.7, -0.2, 0.0, 0.4, 0.9, 1.1])
    sensors = np.column_stack([edge * radius, np.zeros((7, 2))])
    found = light(scene, sensors, zenith=0.0, rays=rays(direct=512))
    s = np.clip(edge, -1.0, 1.0)
    expected = (np.arccos(s) - s * np.sqrt(1.0 - s * s)) / np.pi
    assert found["direct"][:, 0] / BEAM[0] == pytest.approx(expected, abs=0.006)


def test_a_sheet_that_transmits_turns_beam_and_sky_into_scattered_light():
    tau = np.array([0.1, 0.4, 0.2])
    scene = mitsuba_scene.build(
        Scene(of_kinds(leaf=level((-400.0, 400.0), (-400.0, 400.0), 1.0))), optics(tau=tau)
    )
    found = light(scene, zenith=60.0, rays=rays(scattered=512))
    assert (found["direct"] == 0.0).all()
    assert found["sky"][0] == pytest.approx(0.0, abs=0.01)
    assert found["scattered"][0] == pytest.approx(tau * (BEAM * 0.5 + DIFFUSE), rel=0.01)


def test_light_between_a_sheet_and_the_ground_sums_a_geometric_series():
    rho, tau, ground = 0.5, 0.4, 0.6
    scene = mitsuba_scene.build(
        Scene(of_kinds(leaf=level((-400.0, 400.0), (-400.0, 400.0), 0.5))),
        optics(rho=rho, tau=tau, ground=ground),
    )
    found = light(scene, rays=rays(scattered=1024, max_depth=40))
    above = BEAM * np.cos(np.radians(30.0)) + DIFFUSE
    assert found["total"][0] == pytest.approx(tau * above / (1.0 - rho * ground), rel=0.01)


@pytest.mark.parametrize("form", ["polygons", "voxels"])
def test_in_a_furnace_every_sensor_sees_the_same_light(form):
    conserving = optics(rho=[0.55, 0.5, 0.45], tau=[0.45, 0.5, 0.55], bark=1.0, ground=1.0)
    trunk = level((-0.3, 0.3), (-0.3, 0.3), 1.2)
    if form == "polygons":
        meshes = {"leaf": leaves(150, 0.4, (-1, -1, 0.6), (1, 1, 2.0), 3), "wood": trunk}
        scene = Scene(of_kinds(**meshes))
    else:
        density = np.random.default_rng(3).random((4, 3, 2)) * 4.0
        scene = Scene(of_kinds(wood=trunk), voxels(density, 0.5, (-1.0, -0.7, 0.5)))
    sensors = np.array([[0.0, 0.0, 0.0], [0.5, 0.1, 1.0], [0.2, 0.2, 5.0], [-1.0, 2.0, 0.2]])
    much = rays(sky=256, scattered=256, max_depth=400, roulette_depth=400)
    found = light(mitsuba_scene.build(scene, conserving), sensors, beam=0.0 * BEAM, rays=much)
    error = 4.5 * found["standard_error"] + 1e-3 * DIFFUSE
    assert (np.abs(found["total"] - DIFFUSE) < error).all()
    assert (found["standard_error"] < 0.02 * DIFFUSE).all()


@pytest.mark.parametrize("leaf_area_index", [0.5, 3.0])
def test_a_black_turbid_layer_transmits_exponentially(leaf_area_index):
    scene = mitsuba_scene.build(Scene(voxels=slab(leaf_area_index)), optics())
    much = rays(direct=1024, sky=1024)
    for zenith in (0.0, 60.0):
        found = light(scene, zenith=zenith, azimuth=77.0, rays=much)
        cosine = np.cos(np.radians(zenith))
        expected = BEAM * cosine * np.exp(-0.5 * leaf_area_index / cosine)
        error = 4.0 * np.sqrt(expected * BEAM * cosine / (1024 * 16))
        assert (np.abs(found["direct"][0] - expected) < error).all()
    expected = DIFFUSE * 2.0 * expn(3, 0.5 * leaf_area_index)
    assert (np.abs(found["sky"][0] - expected) < 4.0 * DIFFUSE / np.sqrt(1024 * 16)).all()


def test_every_voxel_stands_where_its_coordinates_say():
    rng = np.random.default_rng(4)
    density = 3.0 * rng.random((5, 3, 4)) * (rng.random((5, 3, 4)) < 0.5)
    density[0, 0, 0] = np.nan
    low = np.array([-1.3, 0.7, 0.4])
    scene = Scene(voxels=voxels(density, 0.4, low))
    sensors = low + rng.random((12, 3)) * [2.0, 1.2, 1.6]
    sensors[:6, 2] = 0.1  # half of them below the box, half inside
    found = light(
        mitsuba_scene.build(scene, optics()),
        sensors,
        zenith=35.0,
        azimuth=50.0,
        diffuse=0.0 * DIFFUSE,
        rays=rays(direct=1024),
    )
    way = np.array([[np.sin(0.610865) * np.sin(0.872665), np.sin(0.610865) * np.cos(0.872665)]])
    way = np.column_stack([way, [np.cos(0.610865)]])
    seen = Tracer(scene).sun_visibility(
        sensors, way, n_disc=256, seed=1, sun_diameter_deg=SUN_DIAMETER_DEG
    )
    open_sky = BEAM[0] * np.cos(0.610865)
    assert np.ptp(seen) > 0.3
    assert found["direct"][:, 0] / open_sky == pytest.approx(seen[:, 0], abs=0.016)


def test_an_entrance_across_the_border_of_the_medium_is_shaded_as_a_whole():
    """A wall of leaves in the east, and parts of the entrances in the empty voxels before it."""
    wall = voxels(np.full((1, 40, 40), 3.0), 0.5, (0.0, -10.0, 0.0))
    scene = mitsuba_scene.build(Scene(voxels=wall), optics())
    sensors = np.array([[x, 0.0, 1.0] for x in (-0.8, -0.6, -0.5, -0.4)])
    found = light(
        scene, sensors, zenith=60.0, azimuth=90.0, aperture_m=0.8,
        rays=rays(direct=1024), diffuse=0.0 * DIFFUSE,
    )  # fmt: skip
    expected = 0.5 * BEAM * np.exp(-0.5 * 3.0 * 0.5 / np.sin(np.radians(60.0)))
    assert found["direct"] == pytest.approx(np.tile(expected, (4, 1)), rel=0.03)


def test_light_scattered_once_in_a_turbid_layer_follows_the_phase_function():
    rho, tau, depth = np.array([0.6, 0.0, 0.2]), np.array([0.0, 0.6, 0.4]), 0.5 * 0.8
    scene = mitsuba_scene.build(Scene(voxels=slab(0.8)), optics(rho=rho, tau=tau))
    found = light(
        scene,
        zenith=0.0,
        diffuse=0.0 * DIFFUSE,
        rays=rays(scattered=2048, max_depth=2),
    )
    mu = (np.arange(2000) + 0.5) / 2000
    # extinction on the way in, scattering, extinction on the slanted way out, integrated in depth
    layer = (np.exp(-depth) - np.exp(-depth / mu)) / (1.0 / mu - 1.0)
    for band in range(3):
        onward = (rho + tau)[band] * phase_function(np.arccos(mu), rho[band], tau[band])
        expected = BEAM[band] * 2.0 * np.pi * (onward * layer).mean()
        assert found["scattered"][0, band] == pytest.approx(expected, rel=0.03)


def test_many_small_leaves_do_what_a_turbid_medium_does():
    low, high = np.array([-3.0, -3.0, 1.0]), np.array([3.0, 3.0, 3.0])
    leaf = optics(rho=0.3, tau=0.3, ground=0.3)
    cloud = leaves(14400, 0.1, low, high, 8)  # 144 m2 in 72 m3
    turbid = voxels(np.full((6, 6, 2), 2.0), 1.0, low)
    sensors = np.array([[x, y, 0.5] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)])
    found = [
        light(mitsuba_scene.build(scene, leaf), sensors, rays=rays(scattered=256))
        for scene in (Scene(of_kinds(leaf=cloud)), Scene(voxels=turbid))
    ]
    polygons, medium = ({part: f[part].mean() for part in ("sky", "scattered")} for f in found)
    assert polygons["scattered"] == pytest.approx(medium["scattered"], rel=0.06)
    assert polygons["sky"] == pytest.approx(medium["sky"], rel=0.12)


def test_standard_errors_are_what_repetition_shows():
    scene = mitsuba_scene.build(
        Scene(of_kinds(leaf=leaves(2000, 0.1, (-1, -1, 1), (1, 1, 2), 9))), optics(rho=0.2, tau=0.2)
    )
    sensors = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 3)) * [1.0, 1.0, 0.0]
    much = rays(replicates=16, direct=8, sky=8, scattered=8)
    runs = [light(scene, sensors, rays=much, seed=seed) for seed in range(20)]
    spread = np.var([run["par"] for run in runs], axis=0, ddof=1)
    told = np.mean([run["par_standard_error"] ** 2 for run in runs], axis=0)
    # each ratio scatters by a third, and there are 40 of them
    assert (spread / told).mean() == pytest.approx(1.0, abs=0.2)


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others():
    scene = mitsuba_scene.build(
        Scene(of_kinds(leaf=leaves(500, 0.2, (-1, -1, 1), (1, 1, 2), 9))), optics(rho=0.2, tau=0.2)
    )
    first, between, again = (
        light(scene, azimuth=azimuth, seed=seed) for azimuth, seed in ((40, 7), (90, 8), (40, 7))
    )
    assert all((first[name] == again[name]).all() for name in first)
    other = light(scene, azimuth=40.0, seed=8)
    assert (other["total"] != first["total"]).all()
    assert (between["total"] != first["total"]).all()


def test_night_is_dark_and_dusk_has_no_beam():
    scene = mitsuba_scene.build(Scene(of_kinds(leaf=disc(0.5, 1.0))), optics(rho=0.1))
    night = light(scene, zenith=110.0, beam=0.0 * BEAM, diffuse=0.0 * DIFFUSE)
    assert all((values == 0.0).all() for values in night.values())
    dusk = light(scene, zenith=92.0)
    assert (dusk["direct"] == 0.0).all()
    assert dusk["sky"][0] == pytest.approx(DIFFUSE / 1.25, rel=0.02)
    noon = light(scene, zenith=0.0, diffuse=0.0 * DIFFUSE)
    assert (noon["sky"] == 0.0).all()


def test_few_groups_of_bands_do_for_all_bands():
    nm = np.arange(400.0, 701.0, 15.0)
    green = np.exp(-(((nm - 550.0) / 40.0) ** 2))
    edge = np.clip((nm - 685.0) / 15.0, 0.0, 1.0)
    full = Optics.of_tree(
        nm,
        0.04 + 0.08 * green + 0.15 * edge,
        0.01 + 0.10 * green + 0.12 * edge,
        0.10 + 0.0005 * (nm - 400.0),
        0.03 + 0.05 * green + 0.08 * edge,
    )
    beam = 20.0 + 0.02 * (nm - 400.0)
    diffuse = 6.0 * (500.0 / nm) ** 2
    scene = Scene(of_kinds(leaf=leaves(3000, 0.12, (-1, -1, 0.5), (1, 1, 2.5), 9)))
    sensors = np.random.default_rng(1).uniform(-1.0, 1.0, (30, 3)) * [1.0, 1.0, 0.0]
    much = rays(replicates=4, direct=64, sky=64, scattered=256)

    def par(optics, beam, diffuse):
        built = mitsuba_scene.build(scene, optics)
        return light(built, sensors, beam=beam, diffuse=diffuse, rays=much)["par"]

    def bands(chosen):
        return full.each(lambda values: values[chosen])

    triples = [slice(k, k + 3) for k in range(0, 21, 3)]
    exact = sum(par(bands(k), beam[k], diffuse[k]) for k in triples)
    level = beam.sum() * np.cos(np.radians(30.0)) + diffuse.sum()
    for n, error in ((1, 0.004), (3, 0.001)):
        grouped, group = group_bands(full, beam, diffuse, n)
        found = par(grouped, group_flux(beam, group, n), group_flux(diffuse, group, n))
        assert (found - exact).mean() / level == pytest.approx(0.0, abs=error)


def test_groups_of_bands_keep_flux_and_means():
    full = optics(rho=np.linspace(0.1, 0.3, 7), tau=0.1, n=7)
    flux = np.arange(1.0, 8.0)
    grouped, group = group_bands(full, flux, 0.0 * flux, 3)
    assert (np.diff(group) >= 0).all()
    sums = group_flux(flux, group, 3)
    assert sums.sum() == flux.sum()
    assert (sums * grouped.reflectance["leaf"]).sum() == pytest.approx(
        (flux * full.reflectance["leaf"]).sum()
    )


@pytest.mark.parametrize(
    ("message", "run"),
    [
        ("below the ground", lambda: light(mitsuba_scene.build(Scene(), optics()), ORIGIN - 0.1)),
        ("61 bands", lambda: mitsuba_scene.build(Scene(), optics(n=61))),
        (
            "leaf albedo",
            lambda: mitsuba_scene.build(
                Scene(of_kinds(leaf=disc(1.0, 1.0))), optics(rho=0.7, tau=0.5)
            ),
        ),
        (
            "no reflectance of `fruit`",
            lambda: mitsuba_scene.build(Scene([Surface(disc(1.0, 1.0), "fruit")]), optics()),
        ),
        ("replicates", lambda: rays(replicates=1)),
        (
            "erectophile",
            lambda: mitsuba_scene.build(
                Scene(
                    voxels=voxels(np.ones((1, 1, 1)), leaf_angle_distribution="erectophile"),
                ),
                optics(),
            ),
        ),
    ],
)
def test_what_cannot_be_rendered_is_said(message, run):
    with pytest.raises(InputError, match=message):
        run()
