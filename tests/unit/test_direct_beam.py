"""Direct radiation tells what is missing; and what lux are, of daylight and behind a leaf."""

import numpy as np
import pandas as pd
import prosail
import pvlib
import pytest
from tests.unit.weather import FREIBURG, minutes

from dapple.errors import InputError
from dapple.formats import units
from dapple.sky import radiation_table, sun

TRUTH = minutes(1, start="2023-08-10")


def station(tmp_path, step_min, **columns):
    """Means over steps, stamped with their end, of columns of the truth's minutes."""
    steps = pd.DataFrame(columns, index=TRUTH.index).resample(f"{step_min}min").mean()
    steps.index = steps.index + pd.Timedelta(minutes=step_min)
    path = tmp_path / "station.csv"
    steps.to_csv(path, index_label="time_utc", date_format="%Y-%m-%d %H:%M", float_format="%.3f")
    return path


def facing_the_sun(truth):
    zenith = sun.position(truth.index, *FREIBURG.place)["sun_zenith_deg"].to_numpy()
    cosine = np.cos(np.radians(zenith))
    level = (truth["global_w_m2"] - truth["diffuse_w_m2"]).to_numpy()
    return np.where(cosine > 0.02, level / np.maximum(cosine, 0.02), 0.0)


def means(truth, step_min):
    steps = truth.resample(f"{step_min}min").mean()
    return steps.set_index(steps.index + pd.Timedelta(minutes=step_min))


@pytest.mark.parametrize("step_min", [1, 10, 60])
@pytest.mark.parametrize("kept", ["ghi", "dhi"])
def test_two_of_global_diffuse_and_direct_tell_the_third(tmp_path, step_min, kept):
    beam = facing_the_sun(TRUTH)
    known = TRUTH[{"ghi": "global_w_m2", "dhi": "diffuse_w_m2"}[kept]].to_numpy()
    path = station(tmp_path, step_min, **{kept: known, "dni": beam})
    found = radiation_table.read(
        path, site=FREIBURG, interval_label="end", interval_min=step_min
    ).table
    wanted = means(TRUTH, step_min).reindex(found.index)
    # An hour in which the sun moves and clouds pass is a mean of products, not a product of means.
    near = 25.0 if step_min == 60 else 3.0
    for name in ("global_w_m2", "diffuse_w_m2"):
        np.testing.assert_allclose(found[name], wanted[name], atol=near)


def test_level_direct_radiation_needs_no_sun(tmp_path):
    level = (TRUTH["global_w_m2"] - TRUTH["diffuse_w_m2"]).to_numpy()
    path = station(tmp_path, 10, beam=level, dhi=TRUTH["diffuse_w_m2"].to_numpy())
    found = radiation_table.read(path, direct_plane="horizontal").table
    np.testing.assert_allclose(found["global_w_m2"], means(TRUTH, 10)["global_w_m2"], atol=0.01)


def test_the_wrong_plane_is_refused_where_global_radiation_speaks_against_it(tmp_path):
    beam = facing_the_sun(minutes(1, start="2023-08-10", clouds=False))
    clear = minutes(1, start="2023-08-10", clouds=False)["global_w_m2"].to_numpy()
    path = station(tmp_path, 10, ghi=clear, dni=beam)
    with pytest.raises(InputError, match=r"`radiation\.direct_plane: normal`"):
        radiation_table.read(path, direct_plane="horizontal")


def test_a_beam_of_which_nobody_tells_the_plane_is_left_out_beside_global(tmp_path):
    path = station(tmp_path, 10, ghi=TRUTH["global_w_m2"].to_numpy(), direct=facing_the_sun(TRUTH))
    assert list(radiation_table.read(path).table) == ["global_w_m2"]


# --- what lux are ---------------------------------------------------------------------------------


def luminosity(wavelength_nm):
    """CIE 1931, as a sum of two skewed bells (Wyman, Sloan and Shirley 2013)."""

    def bell(centre, below, above):
        width = np.where(wavelength_nm < centre, below, above)
        return np.exp(-0.5 * ((wavelength_nm - centre) / width) ** 2)

    return 0.821 * bell(568.8, 46.9, 40.5) + 0.286 * bell(530.9, 16.3, 31.1)


@pytest.mark.parametrize("zenith_deg", [20.0, 45.0, 60.0])
def test_lux_of_daylight_and_of_leaf_shade_are_as_stated(zenith_deg):
    spectrum = pvlib.spectrum.spectrl2(
        apparent_zenith=zenith_deg, aoi=zenith_deg, surface_tilt=0, ground_albedo=0.2,
        surface_pressure=101_300, precipitable_water=2.0, ozone=0.31, dayofyear=172,
        relative_airmass=pvlib.atmosphere.get_relative_airmass(zenith_deg),
        aerosol_turbidity_500nm=0.1,
    )  # fmt: skip
    every_nm, irradiance = spectrum["wavelength"], np.ravel(spectrum["poa_global"])
    nm = np.arange(400, 701)
    power = np.interp(nm, every_nm, irradiance)
    leaf = prosail.run_prospect(1.6, 45, 9, 0.0, 0.015, 0.009, prospect_version="D", ant=1.0)
    passed = power * leaf[2][: len(nm)]
    lux = [683 * np.trapezoid(one * luminosity(nm), nm) for one in (power, passed)]
    photons = [np.trapezoid(one * nm, nm) / 119.627 for one in (power, passed)]
    assert lux[0] / photons[0] == pytest.approx(units.DAYLIGHT_LX_PER_UMOL, rel=0.05)
    total = np.trapezoid(irradiance, every_nm)
    assert lux[0] / total == pytest.approx(units.DAYLIGHT_LM_PER_W, rel=0.05)
    assert lux[1] / photons[1] == pytest.approx(2 * units.DAYLIGHT_LX_PER_UMOL, rel=0.15)
