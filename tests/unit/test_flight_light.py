"""Sun and skylight of a flight are those of its time and place, or as stated."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats.rasters import Raster
from dapple.optics.cameras import CAMERAS, ZHAO
from dapple.retrieval import flight_light

STATED = {"sun_zenith_deg": 40.0, "sun_azimuth_deg": 30.0, "time": "", "timezone": "UTC"}
FLIGHT = STATED | {"sun_zenith_deg": None, "sun_azimuth_deg": None}


def images(left_m, top_m, crs):
    return Raster(np.zeros((1, 100, 100), np.float32), left_m, top_m, 0.1, crs, ("450",))


QUITO = images(780_000.0, 9_980_000.0, "EPSG:32717")
SANTIAGO = images(346_000.0, 6_297_010.0, "EPSG:32719")


def test_stated_angles_are_taken_as_they_are_and_need_no_place():
    found = flight_light.sun(STATED, None)
    assert (found["sun_zenith_deg"], found["sun_azimuth_deg"]) == (40.0, 30.0)


def test_the_sun_is_overhead_in_quito_and_in_the_north_in_santiago():
    # At an equinox, at noon by the sun: 12:00 less the equation of time, 7.5 minutes.
    time = {"time": "2024-03-20 12:21", "timezone": "America/Guayaquil"}
    assert flight_light.sun(FLIGHT | time, QUITO)["sun_zenith_deg"] < 1.0
    time = {"time": "2024-03-20 12:50", "timezone": "-04:00"}
    found = flight_light.sun(FLIGHT | time, SANTIAGO)
    assert found["sun_zenith_deg"] == pytest.approx(33.5, abs=0.5)
    assert np.cos(np.radians(found["sun_azimuth_deg"])) > 0.99


def test_a_flight_at_night_is_refused_with_the_place():
    time = {"time": "2024-03-20 12:00", "timezone": "Asia/Tokyo"}
    with pytest.raises(InputError, match=r"horizon.*-0\.181 N.*`timezone`"):
        flight_light.sun(FLIGHT | time, QUITO)


@pytest.mark.parametrize(
    ("zenith_deg", "published"),
    [(58.0, (0.32, 0.19, 0.14, 0.11, 0.09)), (38.53, (0.24, 0.14, 0.11, 0.09, 0.07))],
)
def test_a_cloudless_sky_gives_the_shares_of_the_published_flights(zenith_deg, published):
    found = flight_light.diffuse_share((), zenith_deg, ZHAO)
    assert found["diffuse_share"] == pytest.approx(published, abs=0.02)
    stated = flight_light.diffuse_share(((400.0, 0.4), (900.0, 0.4)), zenith_deg, ZHAO)
    assert stated["diffuse_share"] == pytest.approx([0.4] * 5)
    assert flight_light.shares(stated, np.array([0.05, 0.3])) == pytest.approx(0.4)


def test_the_more_aerosol_the_more_of_the_light_comes_from_the_sky():
    sky = flight_light.diffuse_share((), 40.0, ZHAO)
    found = flight_light.shares(sky, np.array([0.1, 0.15, 0.3]))
    assert found.shape == (3, 5)
    assert found[0] == pytest.approx(sky["diffuse_share"])
    assert (np.diff(found, axis=0) > 0).all()


def test_bands_of_cameras_are_those_of_their_data_sheets():
    """Centre and full width at half maximum [nm], as their makers and ESA (S2A) state them."""
    stated = {
        "p4m": "450/32 560/32 650/32 730/32 840/52",
        "mavic3m": "560/32 650/32 730/32 860/52",
        "rededge-m": "475/20 560/20 668/10 717/10 840/40",
        "rededge-mx": "475/32 560/27 668/14 717/12 842/57",
        "altum": "475/32 560/27 668/14 717/12 842/57",
        "sequoia": "550/40 660/40 735/10 790/40",
        "sentinel-2": "492/66 560/36 665/31 704/15 740/15 783/20 833/106",
    }
    told = {
        name: " ".join(f"{band.centre_nm:g}/{band.width_nm:g}" for band in one)
        for name, one in CAMERAS.items()
    }
    assert told == stated


@pytest.mark.parametrize("name", CAMERAS)
def test_a_camera_tells_sunlit_leaves_and_its_bands_ascend(name):
    centres = [band.centre_nm for band in CAMERAS[name]]
    assert centres == sorted(centres)
    assert centres[CAMERAS[name].near_infrared] > 760
