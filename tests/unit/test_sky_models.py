"""How skies spread their light: closed forms, tables, and the registry of models."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.light import tensor, transport
from dapple.scene import traced
from dapple.scene.surfaces import Scene
from dapple.sky import measured_sky, models, sky_radiance
from dapple.sky.conditions import Conditions, Ways
from dapple.sky.patches import patches

SUN = {"sun_zenith_deg": ("time", [40.0]), "sun_azimuth_deg": ("time", [200.0])}


def sky(model, coefficients=None):
    """A sky dataset of one time."""
    found = xr.Dataset(SUN, attrs={"sky_model": model})
    if coefficients is not None:
        found["sky_coefficients"] = (("time", "coefficient"), np.atleast_2d(coefficients))
    return found


def on_the_level(of_sky):
    """Integral of radiance and cosine over the hemisphere, evenly in cosine-weighted directions."""
    sine = np.sqrt((np.arange(500) + 0.5) / 500)
    azimuth = 360.0 * (np.arange(500) + 0.5) / 500
    zenith = np.degrees(np.arcsin(sine))[:, None]
    return np.pi * sky_radiance.in_directions(of_sky, zenith, azimuth).mean(axis=(1, 2))


def by_a_level_sensor(of_sky, n_patches=577):
    """Irradiance that the transport engine finds at a level sensor in the open."""
    counted = transport.collect(
        traced.load(Scene()),
        np.array([[0.0, 0.0, 1.0]]),
        n_paths=64,
        n_patches=n_patches,
        max_orders=1,
        seed=1,
    )
    dome = patches(n_patches)
    zenith, azimuth = (
        np.degrees(angle)
        for angle in (
            np.arccos(dome.sample(SQUARE)[..., 2]),
            np.arctan2(*np.moveaxis(dome.sample(SQUARE)[..., :2], -1, 0)),
        )
    )
    radiance = sky_radiance.in_directions(of_sky, zenith, azimuth).mean(axis=-1)
    return tensor.straight(counted, radiance).mean()


SQUARE = np.stack(np.meshgrid(*[(np.arange(4) + 0.5) / 4] * 2), axis=-1).reshape(-1, 2)


def test_an_overcast_sky_lights_a_level_sensor_with_seven_ninths_of_pi_of_its_zenith():
    overcast = sky("cie_overcast")
    assert sky_radiance.in_directions(overcast, 0.0, 0.0) == pytest.approx(1.0)
    assert on_the_level(overcast) == pytest.approx(7 * np.pi / 9, rel=1e-4)
    assert by_a_level_sensor(overcast) == pytest.approx(7 * np.pi / 9, rel=1e-3)


def test_an_overcast_sky_is_a_third_as_bright_at_the_horizon_and_the_same_all_around():
    found = sky_radiance.in_directions(sky("cie_overcast"), [0.0, 60.0, 90.0], [10.0, 130.0, 250.0])
    assert found[0] == pytest.approx([1.0, 2 / 3, 1 / 3])


def test_an_even_sky_lights_a_level_sensor_with_pi():
    assert on_the_level(sky("isotropic")) == pytest.approx(np.pi)
    assert by_a_level_sensor(sky("isotropic")) == pytest.approx(np.pi)


def test_a_clear_sky_is_brightest_about_the_sun_and_even_on_both_sides_of_it():
    clear = sky("cie_clear")
    angles = np.linspace(0.0, 89.0, 90)
    towards = sky_radiance.in_directions(clear, angles, 200.0)[0]
    assert angles[towards.argmax()] == 40.0
    left, right = (sky_radiance.in_directions(clear, angles, 200.0 + d)[0] for d in (-70.0, 70.0))
    np.testing.assert_allclose(left, right, rtol=1e-12)
    # At a right angle to the sun only the gradation is left: 1 - exp(-0.32 / cosθ).
    ratio = np.divide(*sky_radiance.in_directions(clear, [50.0, 0.0], [20.0, 0.0])[0])
    expected = (1 - np.exp(-0.32 / np.cos(np.radians(50)))) / (1 - np.exp(-0.32))
    about_zenith = 1 + 10 * (np.exp(-3 * np.radians(40)) - np.exp(-1.5 * np.pi))
    assert ratio == pytest.approx(
        expected / (about_zenith + 0.45 * np.cos(np.radians(40)) ** 2), rel=1e-9
    )


def test_a_measured_sky_has_the_radiance_of_its_patches():
    dome = patches(145)
    radiance = 1 + np.random.default_rng(1).random(145)
    measured = sky("measured", radiance)
    assert sky_radiance.patch_radiance(measured, dome)[0] == pytest.approx(
        radiance / (radiance @ dome.projected_solid_angle_sr)
    )
    low = sky_radiance.in_directions(measured, [90.0, 89.99], [0.0, 12.0])[0]
    assert low == pytest.approx(radiance[[0, 1]])
    assert by_a_level_sensor(measured, 145) == pytest.approx(
        radiance @ dome.projected_solid_angle_sr, rel=1e-5
    )


@pytest.mark.parametrize("name", models.NAMES)
def test_every_model_says_what_it_is_and_gives_light_from_everywhere(name):
    model = models.find(name)
    assert model.__doc__
    zenith, outside = np.array([20.0, 70.0]), np.full(2, 1340.0)
    table = np.ones((2, 145)) if name == "measured" else None
    conditions = Conditions(
        zenith, 2 * zenith, np.full(2, 500.0), np.full(2, 100.0), outside, table
    )
    found = model.coefficients(conditions)
    assert found.shape[0] == 2
    if model.COEFFICIENTS is not None:
        assert found.shape[1] == len(model.COEFFICIENTS)
    radiance = model.radiance(
        found, Ways.under(zenith, 2 * zenith, [[0.0, 89.0]], [[0.0], [200.0]])
    )
    assert radiance.shape == (2, 2, 2)
    assert (radiance > 0).all()


def scanned(dome, **columns):
    """A table of the middles of all patches."""
    ways = dome.directions
    zenith = np.degrees(np.arccos(ways[:, 2]))
    azimuth = np.degrees(np.arctan2(ways[:, 0], ways[:, 1]))
    return pd.DataFrame({"zenith_deg": zenith, "azimuth_deg": azimuth} | columns)


@pytest.mark.parametrize("n", [145, 577])
def test_a_scan_of_all_patches_comes_back_as_it_was_measured(tmp_path, n):
    radiance = np.random.default_rng(2).random(n)
    scanned(patches(n), radiance=radiance).sample(frac=1, random_state=1).to_csv(
        tmp_path / "sky.csv", index=False
    )
    found = measured_sky.read(tmp_path / "sky.csv")
    times = pd.date_range("2023-08-10 10:00", periods=3, freq="10min", tz="UTC")
    assert found.at(times).shape == (3, n)
    assert found.at(times)[1] == pytest.approx(radiance)


def test_between_two_scans_the_sky_changes_evenly_and_outside_them_it_is_not_known(tmp_path):
    both = pd.concat(
        scanned(patches(145), radiance=value, time_utc=f"2023-08-10 1{hour}:00")
        for hour, value in ((0, 1.0), (1, 3.0))
    )
    both.to_csv(tmp_path / "sky.csv", index=False)
    found = measured_sky.read(tmp_path / "sky.csv")
    assert found.at(pd.DatetimeIndex(["2023-08-10 10:15+00:00"])) == pytest.approx(1.5)
    with pytest.raises(InputError, match="a sky from 2023-08-10 10:00"):
        found.at(pd.DatetimeIndex(["2023-08-10 11:01+00:00"]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.drop(columns="radiance"), "a column radiance"),
        (lambda t: t.assign(radiance=-1.0), "line 2: found a radiance of -1"),
        (lambda t: t.iloc[3:], "3 of 145 patches without a direction"),
    ],
)
def test_a_table_that_is_no_whole_sky_is_refused(tmp_path, change, message):
    change(scanned(patches(145), radiance=1.0)).to_csv(tmp_path / "sky.csv", index=False)
    with pytest.raises(InputError, match=message):
        measured_sky.read(tmp_path / "sky.csv")


def test_a_measured_sky_without_a_table_is_an_error():
    nothing = Conditions(*np.ones((5, 1)))
    with pytest.raises(InputError, match="no table"):
        models.find("measured").coefficients(nothing)
