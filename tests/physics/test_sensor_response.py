"""Sensors that are not level planes: what they read in the open, and that both engines agree."""

import drjit
import numpy as np
import pytest
import xarray as xr
from tests.physics.test_surfaces import GREEN, SENSORS, two_species

from dapple.light import tensor, transport
from dapple.light.rays_to_sky import Tracer
from dapple.light.timestep import Rays, timestep
from dapple.optics import sensor_response
from dapple.optics.responses import COSINE, NAMED
from dapple.scene import mitsuba_scene, traced
from dapple.scene.surfaces import Scene
from dapple.sky.open_sky import open_sky_par
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

HEMISPHERICAL = NAMED["hemispherical"]
ANGLES = np.arange(0.0, 91.0, 5.0)
COSINE_IN_A_TABLE = tuple(zip(ANGLES.tolist(), np.cos(np.radians(ANGLES)).tolist(), strict=True))
HALF_BOTH = tuple((angle, 0.5 + 0.5 * cosine) for angle, cosine in COSINE_IN_A_TABLE)
"""As a globe reads that sees only the upper hemisphere."""


@pytest.mark.parametrize(
    "response", [COSINE, HEMISPHERICAL, HALF_BOTH, ((0, 1), (60, 0.2), (90, 0))]
)
def test_engines_read_a_response_between_its_knots_as_numpy_does(response):
    cosine = np.linspace(-0.2, 1.0, 25)
    by_numpy = sensor_response.value(response, cosine)
    by_drjit = [sensor_response.value(response, one, drjit) for one in cosine.tolist()]
    np.testing.assert_allclose(by_drjit, by_numpy, atol=1e-12)


def by_transport(scene, optics, response, n_paths=40_000):
    """Mean and standard error (sensors,) under a sky of radiance 1."""
    counted = transport.collect(
        traced.load(scene),
        SENSORS,
        n_paths=n_paths,
        n_patches=145,
        max_orders=100,
        response=response,
        seed=1,
    )
    sky = np.ones((1, 145))
    light = tensor.straight(counted, sky)[..., 0]
    light = light + tensor.scattered(counted, sky, optics)[..., 0, 0]
    return light.mean(axis=1), light.std(axis=1, ddof=1) / np.sqrt(light.shape[1])


def by_timestep(scene, optics, response, **more):
    """As `by_transport`, by Mitsuba's integrators."""
    sky = {"beam_normal": np.zeros(1), "diffuse_horizontal": np.array([np.pi])} | more
    found = timestep(
        mitsuba_scene.build(scene, optics),
        SENSORS,
        sun_zenith_deg=60.0,
        sun_azimuth_deg=0.0,
        **sky,
        sky=lambda zenith, azimuth: np.ones_like(zenith),
        sun_diameter_deg=SUN_DIAMETER_DEG,
        rays=Rays(16, 64, 2048, 1024, max_depth=100, roulette_depth=20),
        response=response,
        seed=1,
    )
    return found["total"][:, 0], found["standard_error"][:, 0]


@pytest.mark.parametrize("engine", [by_transport, by_timestep])
def test_a_hemispherical_sensor_reads_twice_the_level_one_under_an_open_even_sky(engine):
    level, hemispherical = (engine(Scene(), GREEN, r)[0] for r in (COSINE, HEMISPHERICAL))
    assert level == pytest.approx(np.pi, rel=1e-5)
    assert hemispherical == pytest.approx(2 * level, rel=1e-5)


@pytest.mark.parametrize("engine", [by_transport, by_timestep])
def test_a_response_halfway_between_both_reads_halfway_between_both(engine):
    assert engine(Scene(), GREEN, HALF_BOTH)[0] == pytest.approx(1.5 * np.pi, rel=1e-3)


@pytest.mark.parametrize("engine", [by_transport, by_timestep])
def test_a_table_of_cosines_reads_what_the_cosine_reads(engine):
    (level, _), (table, error) = (
        engine(two_species(), GREEN, r) for r in (COSINE, COSINE_IN_A_TABLE)
    )
    # The same random numbers: what differs is rounding, which few rays near an edge notice.
    assert table == pytest.approx(level, abs=0.1 * error.max())


@pytest.mark.parametrize("response", [HEMISPHERICAL, HALF_BOTH])
def test_both_engines_read_the_same_under_small_crowns(response):
    (one, error), (other, its_error) = (
        engine(two_species(), GREEN, response) for engine in (by_transport, by_timestep)
    )
    assert (np.abs(one - other) < 4 * np.hypot(error, its_error)).all()
    assert np.hypot(error, its_error).max() < 0.01 * one.min()


def test_a_hemispherical_sensor_reads_the_beam_and_a_level_one_its_cosine():
    beam = {"beam_normal": np.array([100.0]), "diffuse_horizontal": np.zeros(1)}
    read = [by_timestep(Scene(), GREEN, r, **beam)[0] for r in (COSINE, HEMISPHERICAL, HALF_BOTH)]
    np.testing.assert_allclose(read, np.full((3, 2), 100.0) * [[0.5], [1.0], [0.75]], rtol=2e-3)


def test_the_open_sky_of_a_hemispherical_sensor_is_the_beam_and_twice_even_diffuse_light():
    sky = xr.Dataset(
        {
            "sun_zenith_deg": ("time", [60.0, 95.0]),
            "sun_azimuth_deg": ("time", [0.0, 0.0]),
            "beam_normal_umol_m2_s": (("time", "band"), [[600.0, 400.0], [0.0, 0.0]]),
            "diffuse_horizontal_umol_m2_s": (("time", "band"), [[100.0, 100.0], [5.0, 5.0]]),
        },
        attrs={"sky_model": "isotropic"},
    )
    np.testing.assert_allclose(open_sky_par(sky), [700.0, 10.0])
    np.testing.assert_allclose(open_sky_par(sky, HEMISPHERICAL), [1400.0, 20.0])


def test_of_an_even_sky_nothing_is_lost_in_the_open_by_any_sensor():
    tracer = Tracer(Scene())
    for response in (COSINE, HEMISPHERICAL, HALF_BOTH):
        assert tracer.sky_visibility(SENSORS, n=64, seed=1, response=response) == pytest.approx(1.0)


@pytest.mark.parametrize("response", [COSINE, HEMISPHERICAL, COSINE_IN_A_TABLE, HALF_BOTH])
def test_directions_are_drawn_as_often_as_light_from_there_counts(response):
    """Evenly spread shares of the reading lie below evenly spread heights, and back."""
    share = np.linspace(0.0, 1.0, 1001)
    level, up = sensor_response.height(response, share)
    np.testing.assert_allclose(level**2 + up**2, 1.0)
    np.testing.assert_allclose(sensor_response.share_below(response, up), share, atol=1e-12)
    cosine = (np.arange(100_000) + 0.5) / 100_000
    mean = 2 * np.pi * sensor_response.value(response, cosine).mean()
    assert sensor_response.integral_sr(response) == pytest.approx(mean, rel=1e-6)
