"""Numbers that others published, and what another program makes of the same input."""

import numpy as np
import pandas as pd
import pvlib
import pytest

from dapple.optics import leaf
from dapple.optics.bands import band_mean, band_width, par_bands, photon_flux
from dapple.sky import sun
from dapple.sky.conditions import Conditions, Ways
from dapple.sky.models import cie_clear, cie_overcast, perez
from dapple.sky.spectrum import par_spectrum
from dapple.stats import correlation, measures, r_bridge
from dapple.times import time_range

# Leaves


def test_a_leaf_reflects_and_passes_what_the_authors_of_prospect_say():
    """PROSPECT-5 as its authors' page computes it (opticleaf.ipgp.fr), to four digits."""
    published = pd.DataFrame(
        [(450, 0.0462, 0.0004), (500, 0.0521, 0.0066), (554, 0.1494, 0.0781),
         (600, 0.0945, 0.0431), (672, 0.0471, 0.0040), (700, 0.1640, 0.0947),
         (750, 0.5092, 0.3480), (800, 0.5280, 0.3693), (1000, 0.5169, 0.3769),
         (1200, 0.4891, 0.3663)],
        columns=["nm", "reflectance", "transmittance"],
    )  # fmt: skip
    wanted = {"n": 2.1, "chlorophyll_ug_cm2": 40.0, "carotenoids_ug_cm2": 10.0, "brown": 0.1,
              "water_cm": 0.015, "dry_matter_g_cm2": 0.009, "anthocyanin_ug_cm2": 0.0}  # fmt: skip
    nm, reflectance, transmittance = leaf._prospect(wanted, "5")
    at = np.searchsorted(nm, published["nm"])
    np.testing.assert_allclose(reflectance[at], published["reflectance"], atol=1e-4)
    np.testing.assert_allclose(transmittance[at], published["transmittance"], atol=1e-4)


# Sunlight


def g173():
    """ASTM G173-03: wavelengths [nm] and spectra [W m⁻² nm⁻¹]."""
    table = pvlib.spectrum.get_reference_spectra(standard="ASTM G173-03")
    return table.index.to_numpy(float), table


def test_the_reference_sun_has_its_photons():
    """1978 µmol m⁻² s⁻¹ in 429.8 W m⁻²: 4.60 µmol J⁻¹, where 4.57 is taken for sunlight in PAR
    (Thimijan and Heins 1983)."""
    nm, table = g173()
    bands = par_bands()
    flux = (band_mean(nm, photon_flux(table["global"], nm), bands) * band_width(bands)).sum()
    inside = (nm >= 400) & (nm <= 700)
    energy = np.trapezoid(table["global"].to_numpy()[inside], nm[inside])
    constants = 6.62607015e-34 * 299_792_458 * 6.02214076e23
    by_hand = np.trapezoid((table["global"] * nm * 1e-3 / constants).to_numpy()[inside], nm[inside])
    assert flux == pytest.approx(by_hand, rel=2e-4)
    assert flux == pytest.approx(1978, abs=1)
    assert flux / energy == pytest.approx(4.57, rel=0.01)


def test_a_beam_through_the_reference_atmosphere_has_the_reference_photons():
    nm, table = g173()
    bands = par_bands()
    expected = (band_mean(nm, photon_flux(table["direct"], nm), bands) * band_width(bands)).sum()
    beam, _ = par_spectrum(
        time_range("2023-04-01 12:00", "2023-04-01 12:00", 1, "UTC"),
        np.array([48.19]),
        np.array([np.trapezoid(table["direct"].to_numpy(), nm)]),
        np.array([100.0]),
        sun.Site(37.0, 0.0, 0.0),
        bands,
        precipitable_water_cm=1.4164,
        ozone_atm_cm=0.3438,
        aerosol_optical_depth_500nm=0.084,
    )
    assert beam.sum() == pytest.approx(expected, rel=0.02)


# Skies


def along(zenith_deg, azimuth_deg, sun_zenith_deg=60.0):
    return Ways.under(np.array([sun_zenith_deg]), np.array([180.0]), zenith_deg, azimuth_deg)


def relative(model, zenith_deg, azimuth_deg, sun_zenith_deg=60.0):
    """Radiance over that of the zenith."""
    none = np.empty((1, 0))
    there = model.radiance(none, along(zenith_deg, azimuth_deg, sun_zenith_deg))
    return there / model.radiance(none, along(0.0, 0.0, sun_zenith_deg))


@pytest.mark.parametrize("zenith_deg", [0.0, 30.0, 60.0, 80.0])
def test_an_overcast_sky_follows_moon_and_spencer(zenith_deg):
    expected = (1 + 2 * np.cos(np.radians(zenith_deg))) / 3
    assert relative(cie_overcast, zenith_deg, 77.0).item() == pytest.approx(expected)


@pytest.mark.parametrize(("zenith_deg", "azimuth_deg"), [(30, 180), (60, 0), (80, 90), (45, 225)])
@pytest.mark.parametrize("sun_zenith_deg", [20.0, 60.0])
def test_a_clear_sky_follows_the_standard_of_the_cie(zenith_deg, azimuth_deg, sun_zenith_deg):
    """L/Lz = f(χ) φ(Z) / [f(Zs) φ(0)], type 12 of CIE S 011."""
    z, zs, turn = np.radians([zenith_deg, sun_zenith_deg, azimuth_deg - 180.0])
    chi = np.arccos(np.cos(zs) * np.cos(z) + np.sin(zs) * np.sin(z) * np.cos(turn))

    def indicatrix(angle):
        return (1 + 10 * (np.exp(-3 * angle) - np.exp(-3 * np.pi / 2))
                + 0.45 * np.cos(angle) ** 2)  # fmt: skip

    def gradation(angle):
        return 1 - np.exp(-0.32 / np.cos(angle))

    expected = indicatrix(chi) * gradation(z) / (indicatrix(zs) * gradation(0.0))
    found = relative(cie_clear, zenith_deg, azimuth_deg, sun_zenith_deg)
    assert found.item() == pytest.approx(expected, rel=1e-6)


# Table 1 of Perez, Seals and Michalsky (1993), written down a second time: below a clearness of
# each range x1 to x4 of a, b, c, d and e.
PUBLISHED = {
    1.03: """1.3525 -.2576 -.269 -1.4366  -.767 .0007 1.2734 -.1233  2.8 .6004 1.2375 1
             1.8734 .6297 .9738 .2809  .0356 -.1246 -.5718 .9938""",
    1.1: """-1.2219 -.773 1.4148 1.1016  -.2054 .0367 -3.9128 .9156  6.975 .1774 6.4477 -.1239
            -1.5798 -.5081 -1.7812 .108  .2624 .0672 -.219 -.4285""",
    1.4: """-1.1 -.2515 .8952 .0156  .2782 -.1812 -4.5 1.1766  24.7219 -13.0812 -37.7 34.8438
            -5 1.5218 3.9229 -2.6204  -.0156 .1597 .4199 -.5562""",
    1.7: """-.5484 -.6654 -.2672 .7117  .7234 -.6219 -5.6812 2.6297  33.3389 -18.3 -62.25 52.0781
            -3.5 .0016 1.1477 .1062  .4659 -.3296 -.0876 -.0329""",
    2.3: """-.6 -.3566 -2.5 2.325  .2937 .0496 -5.6812 1.8415  21 -4.7656 -21.5906 7.2492
            -3.5 -.1554 1.4062 .3988  .0032 .0766 -.0656 -.1294""",
    3.5: """-1.0156 -.367 1.0078 1.4051  .2875 -.5328 -3.85 3.375  14 -.9999 -7.1406 7.5469
            -3.4 -.1078 -1.075 1.5702  -.0672 .4016 .3017 -.4844""",
    5.5: """-1 .0211 .5025 -.5119  -.3 .1922 .7023 -1.6317  19 -5 1.2438 -1.9094
            -4 .025 .3844 .2656  1.0468 -.3788 -2.4517 1.4656""",
    7.5: """-1.05 .0289 .426 .359  -.325 .1156 .7781 .0025  31.0625 -14.5 -46.1148 55.375
            -7.2312 .405 13.35 .6234  1.5 -.6426 1.8564 .5636""",
}


@pytest.mark.parametrize("clearness", PUBLISHED)
def test_the_sky_of_perez_has_the_coefficients_of_the_published_table(clearness):
    zenith, outside, diffuse = np.radians(40.0), 1350.0, 300.0
    cubed = 1.041 * zenith**3
    beam = diffuse * (clearness * (1 + cubed) - cubed - 1)
    found = perez.coefficients(
        Conditions(*(np.array([x]) for x in (40.0, 180.0, beam, diffuse, outside)))
    )[0]
    brightness = diffuse / outside * pvlib.atmosphere.get_relative_airmass(40.0)
    table = np.array(PUBLISHED[clearness].split(), float).reshape(5, 4)
    expected = table @ [1.0, zenith, brightness, brightness * zenith]
    if clearness < 1.065:
        (c1, c2, c3, c4), (d1, d2, d3, d4) = table[2:4]
        expected[2] = np.exp((brightness * (c1 + c2 * zenith)) ** c3) - c4
        expected[3] = -np.exp(brightness * (d1 + d2 * zenith)) + d3 + brightness * d4
    expected[1] = min(expected[1], 0.0)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


# Statistics


def test_agreement_is_what_r_makes_of_the_same_records(tmp_path):
    rng = np.random.default_rng(4)
    simulated = rng.uniform(100, 1600, (8, 40))
    records = pd.DataFrame(
        {
            "reconstruction": "polygons",
            "sensor": np.repeat([f"1_{k}" for k in range(8)], 40),
            "time": np.tile(pd.date_range("2023-08-10 10:00Z", periods=40, freq="min"), 8),
            "measured": (0.9 * simulated + rng.normal(0, 150, simulated.shape)).ravel(),
            "simulated": simulated.ravel(),
        }
    )
    (tmp_path / "own.R").write_text(
        "own <- function(d) { e <- d$simulated - d$measured; data.frame("
        "r = cor(d$measured, d$simulated), rmse = sqrt(mean(e^2)), bias = mean(e), "
        "mae = mean(abs(e))) }\n"
        "by_sensor <- function(d) do.call(rbind, lapply(split(d, d$sensor), function(s) "
        "data.frame(sensor = s$sensor[1], r = cor(s$measured, s$simulated), "
        "rmse = sqrt(mean((s$simulated - s$measured)^2)))))\n"
    )
    plain = records[["sensor", "measured", "simulated"]]
    of_r = r_bridge.call(tmp_path / "own.R", "own", plain).iloc[0]
    ours = correlation.overall(records, seed=1).iloc[0]
    for name in ("r", "rmse", "bias", "mae"):
        assert ours[name] == pytest.approx(of_r[name], rel=1e-10), name
    of_r = r_bridge.call(tmp_path / "own.R", "by_sensor", plain).sort_values("sensor")
    ours = measures.per_sensor(records).sort_values("sensor")
    for name in ("r", "rmse"):
        np.testing.assert_allclose(ours[name], of_r[name], rtol=1e-10)
