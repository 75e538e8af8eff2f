"""Clear hours return to one level, and clouds do not: that tells a unit in dark months too."""

import re

import numpy as np
import pandas as pd
import pytest
from tests.unit.weather import FREIBURG, dark, station

from dapple.sky import clear_hours, plausible, radiation_unit, sun

STEPS = ((10, "end"), (60, "start"))
DARK = {
    "Freiburg in December": (FREIBURG, "2023-12-03"),
    "Edinburgh in December": (sun.Site(55.95, -3.2, 50.0), "2023-12-05"),
    "Hobart in June": (sun.Site(-42.9, 147.3, 20.0), "2023-06-01"),
    "Tromsø in February": (sun.Site(69.65, 18.96, 10.0), "2023-02-15"),
}


def days_of(levels, hours=8, noise=0.0, seed=1):
    """Ratios to a clear sky by the hour: one level a day, and what clouds add to it."""
    rng = np.random.default_rng(seed)
    ratio = np.concatenate([one * np.exp(rng.normal(0.0, noise, hours)) for one in levels])
    return ratio, np.full(len(ratio), 20.0), np.repeat(np.arange(len(levels)), hours)


@pytest.mark.parametrize("unit", [1.0, 0.36, 0.06, 1e-3])
def test_days_of_one_level_among_others_are_the_clear_ones(unit):
    clouds = unit * np.exp(np.random.default_rng(1).normal(np.log(0.25), 0.4, 20))
    ratio, elevation, day = days_of([*np.minimum(clouds, 0.8 * unit), unit, 0.97 * unit, unit])
    found = clear_hours.level(ratio, elevation, day, 60.0)
    # Every cloudy day is as smooth here: of 23 days three are clear, which is too little.
    assert found is None
    cloudy, *_ = days_of(np.minimum(clouds, 0.8 * unit), noise=0.2)
    ratio = np.concatenate([cloudy, ratio[len(cloudy) :]])
    found = clear_hours.level(ratio, elevation, day, 60.0)
    assert found.days == 3
    assert found.ratio == pytest.approx(unit)


def test_no_level_is_made_of_clouds_nor_of_a_low_sun():
    ratio, elevation, day = days_of(np.full(30, 0.4), noise=0.2)
    assert clear_hours.level(ratio, elevation, day, 60.0) is None
    ratio, elevation, day = days_of(np.ones(30))
    assert clear_hours.level(ratio, 0.0 * elevation + 4.0, day, 60.0) is None


def test_brighter_hours_than_the_level_of_smooth_days_are_no_clear_sky():
    ratio, elevation, day = days_of([0.4] * 10 + [0.9] * 10, noise=0.0)
    ratio[day >= 10] *= np.random.default_rng(1).uniform(0.3, 1.0, 80)
    assert clear_hours.level(ratio, elevation, day, 60.0) is None


@pytest.mark.parametrize("place", DARK)
def test_another_unit_is_found_and_named_in_dark_months_without_diffuse_radiation(place):
    site, start = DARK[place]
    truth = dark(30, 5, start=start, site=site)
    for step_min, label in STEPS:
        assert plausible.check(station(truth, step_min, label, only_global=True), site) == []
        for unit, factor in radiation_unit.unit_factors(step_min).items():
            if factor > 100.0 or factor < 0.01:
                continue  # no dark month hides these
            wrong = station(truth, step_min, label, factor=factor, only_global=True)
            (doubt, *_) = plausible.check(wrong, site)
            word = "PAR in µmol" if unit == "umol/m2/s" else f"{unit}"
            assert word in doubt.remedy, (step_min, unit, doubt)
            # Haze takes up to half of the light at a low sun.
            assert doubt.level == ("warning" if 0.5 < factor < 1.0 else "error"), (step_min, unit)


@pytest.mark.parametrize("place", [*DARK][:2])
def test_a_month_without_a_clear_hour_is_said_to_tell_no_unit(place):
    site, start = DARK[place]
    truth = dark(30, 0, start=start, site=site)
    for step_min, label in STEPS:
        for factor in (1.0, 0.36):
            measured = station(truth, step_min, label, factor=factor, only_global=True)
            (doubt,) = plausible.check(measured, site)
            assert doubt.level == "warning"
            assert re.match("too few clear hours to check the unit", doubt.found)
            stated = {"columns": {"global_w_m2": "G"}, "units": {"G": "W/m2"}}
            measured.facts.update(stated)
            (doubt,) = plausible.check(measured, site)
            assert doubt.level == "note"


def test_hours_brighter_than_any_cloud_makes_them_are_another_unit_in_an_overcast_month():
    truth = dark(30, 0, start="2023-06-03")
    wrong = station(truth, 60, "end", factor=3.6, only_global=True)
    (doubt,) = plausible.check(wrong, FREIBURG)
    assert doubt.level == "error"
    assert "kJ/m2" in doubt.remedy  # beside PAR, which it may be as well


def test_a_day_of_a_broken_sensor_is_no_other_unit():
    measured = station(dark(12, 5, start="2023-10-10"), 10, "end", only_global=True)
    measured.table.iloc[-90:] = 1688.5
    found = plausible.check(measured, FREIBURG)
    assert [one.level for one in found if "1688" in one.found] == ["error"]
    assert not [one for one in found if "radiation.unit" in one.remedy or "PAR" in one.remedy]


def test_a_sun_that_stays_low_tells_no_unit():
    site = sun.Site(69.65, 18.96, 10.0)
    truth = dark(10, 10, start="2023-01-18", site=site)
    (doubt,) = plausible.check(station(truth, 10, "end", factor=0.06), site)
    assert "a sun never above 5°" in doubt.found


def test_noise_within_seconds_does_not_hide_the_level():
    rows = 4 * 60 * 8
    ratio, elevation, day = days_of(np.ones(4), hours=rows, noise=0.05)
    found = clear_hours.level(ratio, elevation, day, 0.25)
    assert found.days == 4
    assert found.ratio == pytest.approx(1.0, rel=0.01)


def test_a_negative_or_missing_row_does_not_hide_the_level():
    ratio, elevation, day = days_of(np.ones(6))
    ratio[3], ratio[20] = np.nan, -0.1
    assert clear_hours.level(ratio, elevation, day, 60.0).ratio == pytest.approx(1.0)
    assert pd.isna(ratio[3])
