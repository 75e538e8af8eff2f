"""Tilted sensors by every engine against closed forms: sun, even sky, ground, crown."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest
from tests.physics.test_less import BEAM, DIFFUSE, PEREZ, sky
from tests.physics.test_timestep import disc, optics

from dapple import steps
from dapple.light import less_engine, light_datasets
from dapple.light.less_files import LessRays
from dapple.light.light_model import Model, Tracing
from dapple.light.timestep_series import Reference
from dapple.optics.responses import NAMED
from dapple.scene import traced
from dapple.scene.facing import facing_of
from dapple.scene.sensors import POSITION
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.open_sky import open_sky_par

ENGINES = [
    "transport",
    "timestep",
    pytest.param(
        "less",
        marks=pytest.mark.skipif(find_spec("less") is None, reason="less3d is not installed"),
    ),
]
LEVEL, DOWN = (0.0, 0.0), (180.0, 0.0)
TILTS = [LEVEL, (30.0, 180.0), (60.0, 90.0), (90.0, 315.0)]
SUN = (40.0, 150.0)
ALBEDO = 0.3


def sensors(*angles, z_m=0.02):
    table = pd.DataFrame({"sensor": [f"1_{k}" for k in range(len(angles))]})
    table[POSITION] = [(k, 0.0, z_m) for k in range(len(angles))]
    table[["tilt_deg", "azimuth_deg"]] = np.array(angles, float)
    return table


def light(engine, scene, above, table, *, ground=0.0, response=NAMED["cosine"], aperture_m=0.0):
    """Light at the sensors at the only time, a row each: direct, sky, scattered."""
    spectra = optics(rho=0.1, tau=0.1, ground=ground)
    if engine == "less":
        rays = LessRays(12800, 32, max_orders=12, sun_diameter_deg=0.533, seed=1)
        found = less_engine.series(
            [scene], above, spectra, table, bands=3, rays=rays, aperture_m=aperture_m
        )
    elif engine == "timestep":
        found = Reference(
            [scene], above, spectra, bands=3, sun_diameter_deg=0.533, replicates=16,
            direct_rays=64, sky_rays=256, scattered_rays=256, max_depth=8, aperture_m=aperture_m,
            response=response, variant="llvm_ad_rgb", seed=1,
        ).at(0, table)  # fmt: skip
    else:
        found = _by_transport(scene, above, table, spectra, response, aperture_m)
    names = ("par_direct_umol_m2_s", "par_sky_umol_m2_s", "par_scattered_umol_m2_s")
    return np.column_stack([found[name].to_numpy()[:, 0] for name in names])


def _by_transport(scene, above, table, spectra, response, aperture_m):
    loaded, facing = traced.load(scene), facing_of(table)
    model = Model(sky_patches=577, max_orders=12, bands=3)
    tracing = Tracing(
        paths=65536, sky_rays=65536, max_shadow_rays=4096, tolerance=0.005, sun_diameter_deg=0.533,
        sun_kernel_deg=8.0, aperture_m=aperture_m, response=response,
    )  # fmt: skip
    places = table[POSITION].to_numpy()
    sunlit = steps.sun(loaded, places, above, model, tracing, facing=facing, seed=1)
    paths = steps.paths(loaded, places, model, tracing, facing=facing, seed=1)
    of_all = steps.products(sunlit, paths, above, spectra, model, tracing, facing)
    times = pd.DatetimeIndex(above["time"].to_numpy()).tz_localize("UTC")
    return light_datasets.as_dataset(of_all, table["sensor"], times)


def incidence(table, sun=SUN):
    towards = facing_of(sensors(sun))[0]
    return np.maximum(facing_of(table) @ towards, 0.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_tilted_plate_over_black_ground_reads_the_cosine_of_the_sun_and_its_part_of_an_even_sky(
    engine,
):
    table = sensors(*TILTS)
    found = light(engine, Scene(), sky(SUN), table)
    up = np.cos(np.radians(table["tilt_deg"].to_numpy()))
    assert found[:, 0] == pytest.approx(BEAM.sum() * incidence(table), rel=3e-3, abs=0.1)
    # in LESS an upright plate sees a little past the end of the ground
    assert found[:, 1] == pytest.approx(DIFFUSE.sum() * (1 + up) / 2, rel=0.01)
    assert found[:, 2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_bright_ground_lights_a_tilted_plate_from_below_and_a_turned_one_reads_what_it_reflects(
    engine,
):
    table, dark = sensors(*TILTS, DOWN), np.zeros(3)
    up = np.cos(np.radians(table["tilt_deg"].to_numpy()))
    # the transport engine averages the scattered sun over some degrees, by fewer paths
    of_level = {"beam": BEAM.sum() * np.cos(np.radians(SUN[0])), "diffuse": DIFFUSE.sum()}
    for part, tolerance in (("beam", 0.06), ("diffuse", 0.015)):
        above = sky(SUN, **{"beam": dark, "diffuse": dark, part: globals()[part.upper()]})
        found = light(engine, Scene(), above, table, ground=ALBEDO)
        expected = ALBEDO * of_level[part] * (1 - up) / 2
        few = 0.005 * of_level[part]  # where hardly a ray meets the ground
        assert found[:, 2] == pytest.approx(expected, rel=tolerance, abs=few)
        assert found[-1, :2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_under_an_uneven_sky_a_plate_reads_most_where_it_faces_the_sun(engine):
    table = sensors((50.0, 150.0), (50.0, 330.0))
    above = sky(SUN, beam=np.zeros(3), coefficients=PEREZ)
    found = light(engine, Scene(), above, table)[:, 1]
    expected = open_sky_par(above, facing=facing_of(table)).to_numpy()[:, 0]
    assert expected[0] > 1.5 * expected[1]
    assert found == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_disc_that_a_plate_faces_takes_the_same_share_of_an_even_sky_however_both_are_turned(
    engine,
):
    """A black disc, 45° seen from its axis, takes sin² 45° = half of what lies above the plate."""
    crown = disc(1.0, 1.0, n=180)
    tilt = np.radians(30.0)
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    turned = replace(crown, vertices_m=crown.vertices_m @ turn.T + [0.0, 0.0, 1.0])
    above = sky((30.0, 90.0))
    found = light(engine, Scene(of_kinds(wood=turned)), above, sensors((30.0, 90.0), z_m=1.0))[0]
    assert found[0] == pytest.approx(0.0, abs=1e-6)
    share = (1 + np.cos(tilt)) / 2 - 0.5
    assert found[1] == pytest.approx(DIFFUSE.sum() * share, rel=0.02)


@pytest.mark.parametrize("engine", ["transport", "timestep"])
def test_a_hemispherical_sensor_that_is_turned_sees_half_of_the_sky_at_a_right_angle(engine):
    table = sensors((90.0, 150.0), (90.0, 330.0))
    found = light(engine, Scene(), sky(SUN), table, response=NAMED["hemispherical"])
    assert found[:, 0] == pytest.approx([BEAM.sum(), 0.0], rel=3e-3, abs=1e-6)
    # an even sky of irradiance E has the radiance E / pi; half of it spans pi sr
    assert found[:, 1] == pytest.approx(DIFFUSE.sum(), rel=0.01)


@pytest.mark.parametrize("engine", ["transport", "timestep"])
def test_a_wide_upright_entrance_reaches_across_an_edge_above_it_and_not_beside_it(engine):
    """Half of an upright entrance of 20 cm lies below a roof that begins at its middle height."""
    roof = disc(5.0, 1.0, n=60)
    table = sensors((90.0, 90.0), z_m=1.0)
    # the sun in the west-east plane, low enough to reach only what lies above the roof
    above = sky((60.0, 90.0), diffuse=np.zeros(3))
    scene = Scene(of_kinds(wood=roof))
    found = light(engine, scene, above, table, aperture_m=0.2)[0, 0]
    assert found == pytest.approx(0.5 * BEAM.sum() * np.sin(np.radians(60.0)), rel=0.03)


def test_level_sensors_do_not_read_otherwise_where_angles_are_written_down():
    scene, above = Scene(of_kinds(leaf=disc(1.0, 2.0))), sky(SUN)
    told = sensors(LEVEL)
    for engine, largest in (("transport", 0.01), ("timestep", 1e-6)):
        plain = light(engine, scene, above, told.drop(columns=["tilt_deg", "azimuth_deg"]))
        assert light(engine, scene, above, told) == pytest.approx(plain, rel=largest, abs=0.2)
