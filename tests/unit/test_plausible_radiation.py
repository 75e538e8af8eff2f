"""Radiation tells its own unit, label and clock: wrong tables are named, right ones pass."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.weather import FREIBURG, minutes, station

from dapple.errors import InputError
from dapple.findings import stop
from dapple.sky import plausible, radiation_clock, sun

STATIONS = {
    "Freiburg": (FREIBURG, "2023-08-01"),
    "Freiburg in winter": (FREIBURG, "2023-01-01"),
    "Quito": (sun.Site(-0.18, -78.47, 2850.0), "2023-03-10"),
    "Santiago": (sun.Site(-33.45, -70.66, 570.0), "2023-12-01"),
    "Tromsø": (sun.Site(69.65, 18.96, 10.0), "2023-05-20"),
}


@pytest.mark.parametrize("place", STATIONS)
@pytest.mark.parametrize("only_global", [False, True])
def test_thirty_days_of_weather_raise_no_doubt(place, only_global):
    site, start = STATIONS[place]
    truth = minutes(30, start=start, site=site)
    for step_min, label in ((10, "end"), (15, "start"), (60, "end")):
        measured = station(truth, step_min, label, only_global=only_global)
        assert plausible.check(measured, site) == []


def test_cloud_edges_and_negative_nights_are_not_refused():
    truth = minutes(2, start="2023-08-10", clouds=False)
    truth.loc["2023-08-10 11:30":"2023-08-10 11:31", "global_w_m2"] *= 1.35
    truth[truth < 1] = -4.0
    doubts = plausible.check(station(truth, 1, "instant"), FREIBURG)
    assert not [one for one in doubts if one.level == "error"]


THIRTY = minutes(30)


@pytest.mark.parametrize("only_global", [False, True])
@pytest.mark.parametrize(
    ("step_min", "factor", "unit"),
    [
        (10, 0.06, "J/cm2"),
        (60, 0.36, "J/cm2"),
        (60, 3.6, "kJ/m2"),
        (60, 1e-3, "kWh/m2"),
        (60, 3.6e-3, "MJ/m2"),
        (10, 1 / 6, "Wh/m2"),
        (10, 2.06, "PAR in µmol"),
    ],
)
def test_another_unit_is_found_and_named(step_min, factor, unit, only_global):
    wrong = station(THIRTY, step_min, "end", factor=factor, only_global=only_global)
    with pytest.raises(InputError, match=f"fits {unit}"):
        stop(plausible.check(wrong, FREIBURG))


@pytest.mark.parametrize("only_global", [False, True])
@pytest.mark.parametrize("step_min", [10, 15, 60])
@pytest.mark.parametrize(
    ("label", "assumed"), [("end", "start"), ("start", "end"), ("end", "instant")]
)
def test_another_label_is_found_and_named(step_min, label, assumed, only_global):
    wrong = station(THIRTY, step_min, label, assumed=assumed, is_declared=False,
                    only_global=only_global)  # fmt: skip
    with pytest.raises(InputError, match=f"`radiation.interval_label: {label}`"):
        stop(plausible.check(wrong, FREIBURG))


@pytest.mark.parametrize(
    ("ahead_min", "offset"), [(60, "+01:00"), (120, "+02:00"), (-300, "-05:00"), (23, "+00:23")]
)
def test_another_clock_is_found_with_the_offset_to_declare(ahead_min, offset):
    wrong = station(THIRTY, 10, "end", ahead_min=ahead_min)
    with pytest.raises(InputError, match=re.escape(f"`radiation.timezone: '{offset}'`")):
        stop(plausible.check(wrong, FREIBURG))


@pytest.mark.parametrize("longitude_deg", [-123.0, -78.0, 8.0, 147.0])
def test_a_clock_that_is_ahead_is_found_at_any_longitude(longitude_deg):
    site = sun.Site(40.0, longitude_deg, 100.0)
    truth = minutes(5, start="2023-08-01", site=site, clouds=False)
    found = radiation_clock.offset(station(truth, 10, "end", ahead_min=60), site)
    assert found is not None
    assert found.minutes == pytest.approx(-60.0, abs=2.0)


@pytest.mark.parametrize("hours", [-10, -5, 3, 8, 11])
def test_another_clock_is_found_under_the_midnight_sun(hours):
    site, _ = STATIONS["Tromsø"]
    truth = minutes(20, start="2023-06-10", site=site)
    for step_min in (10, 60):
        wrong = station(truth, step_min, "end", ahead_min=60 * hours, only_global=True)
        offset = f"`radiation.timezone: '{hours:+03d}:00'`"
        with pytest.raises(InputError, match=re.escape(offset)):
            stop(plausible.check(wrong, site))


def test_a_declared_label_that_the_sun_contradicts_a_little_is_only_a_warning():
    wrong = station(THIRTY, 15, "end", assumed="middle")
    (doubt,) = plausible.check(wrong, FREIBURG)
    assert doubt.level == "warning"
    assert "`radiation.interval_label: end`" in doubt.remedy


def test_light_at_night_is_another_zone_whatever_the_weather():
    truth = minutes(5, seed=3)
    truth["global_w_m2"] *= np.random.default_rng(1).uniform(0.3, 1.0, len(truth))  # no clear day
    truth["diffuse_w_m2"] = truth["global_w_m2"]
    wrong = station(truth, 10, "end", ahead_min=-300)
    with pytest.raises(InputError, match="below the horizon"):
        stop(plausible.check(wrong, FREIBURG))


def test_sun_at_too_little_light_is_another_unit_where_clouds_come_every_other_hour():
    truth = minutes(6, clouds=False)
    is_cloudy = truth.index.hour % 2 == 0
    truth.loc[is_cloudy, "global_w_m2"] *= 0.3
    truth.loc[is_cloudy, "diffuse_w_m2"] = truth["global_w_m2"]
    right = plausible.check(station(truth, 60, "start"), FREIBURG)
    assert [one.level for one in right] == ["warning"]  # too few clear hours tell the unit
    wrong = plausible.check(station(truth, 60, "start", factor=0.36), FREIBURG)
    assert "on the best day" in wrong[0].found
    assert wrong[0].level == "error"


def test_columns_that_are_exchanged_are_named():
    right = station(THIRTY, 10, "end")
    swapped = right.table.set_axis(["diffuse_w_m2", "global_w_m2"], axis="columns")
    with pytest.raises(InputError, match=r"`radiation.global_column: D`"):
        stop(plausible.check(replace(right, table=swapped), FREIBURG))


def test_a_diffuse_column_in_another_unit_is_found():
    table = station(THIRTY, 10, "end").table
    wrong = replace(
        station(THIRTY, 10, "end"), table=table.assign(diffuse_w_m2=table["diffuse_w_m2"] * 0.06)
    )
    with pytest.raises(InputError, match="clean air alone scatters more"):
        stop(plausible.check(wrong, FREIBURG))


@pytest.mark.parametrize(
    ("value", "sun_text"), [(3000.0, "physically possible"), (-60.0, "-20 to")]
)
def test_a_single_impossible_row_is_named(value, sun_text):
    measured = station(THIRTY, 10, "end")
    measured.table.iloc[70, 0] = value
    with pytest.raises(InputError, match=sun_text):
        stop(plausible.check(measured, FREIBURG))


def test_half_a_day_says_nothing_of_the_clock():
    truth = minutes(1, start="2023-08-10", clouds=False)["2023-08-10 11:00":"2023-08-10 16:50"]
    assert radiation_clock.offset(station(truth, 10, "instant", ahead_min=60), FREIBURG) is None


def test_a_sensor_out_of_level_does_not_move_the_clock():
    truth = minutes(3, start="2023-08-10", clouds=False)
    where = sun.position(truth.index, *FREIBURG.place)
    zenith, azimuth = (np.radians(where[name]) for name in ("sun_zenith_deg", "sun_azimuth_deg"))
    tilt = np.radians(1.0)  # towards east
    beam = truth["global_w_m2"] - truth["diffuse_w_m2"]
    seen = 1 + np.tan(np.minimum(zenith, np.radians(85))) * np.tan(tilt) * np.cos(
        azimuth - np.pi / 2
    )
    tilted = truth.assign(global_w_m2=truth["diffuse_w_m2"] + beam * seen)
    found = radiation_clock.offset(station(tilted, 10, "instant"), FREIBURG)
    assert found is None or abs(found.minutes) < 3.0
