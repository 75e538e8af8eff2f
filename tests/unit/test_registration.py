"""Co-registration on moving shadows whose place and time are known."""

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.registration.fit import register, split
from dapple.registration.shading import open_sky_gain

SENSORS_M = np.random.default_rng(7).uniform(-3, 3, (20, 2))
BRANCHES = np.random.default_rng(8).uniform(-5, 5, (40, 3)) * [1, 1, 0.25] + [0, 0, 3.5]
RECORD_S = np.arange(0.0, 4 * 3600, 150)
FINE_S = np.arange(-600.0, 4 * 3600 + 601, 100)


def shadows(shifts_m, time_s):
    """Light under opaque blobs 0.35 m wide at 2 to 5 m, in a sun that turns and sinks."""
    angle = 2 * np.pi * np.asarray(time_s) / 86400
    slope = np.stack([np.sin(angle) + 0.2, -np.cos(angle)], axis=1)  # shadow offset per height
    shadow = BRANCHES[:, None, :2] + BRANCHES[:, None, 2:] * slope
    light = np.empty((len(shifts_m), len(SENSORS_M), len(time_s)))
    for k, shift in enumerate(shifts_m):
        for s, sensor in enumerate(SENSORS_M):
            square = ((shadow + shift - sensor) ** 2).sum(axis=-1)
            light[k, s] = 150 + 1400 * np.exp(-np.exp(-square / (2 * 0.35**2)).sum(axis=0))
    return light


def records(east_m, north_m, clock_offset_s, noise=30.0):
    """What loggers with a clock that is ahead by the offset write down."""
    light = shadows([(east_m, north_m)], RECORD_S - clock_offset_s)[0]
    return light + np.random.default_rng(9).normal(0, noise, light.shape)


def test_a_known_shift_and_clock_offset_are_recovered():
    result = register(
        records(0.43, -0.31, 95.0), RECORD_S, lambda shifts: shadows(shifts, FINE_S), FINE_S
    )
    assert result.east_m == pytest.approx(0.43, abs=0.04)
    assert result.north_m == pytest.approx(-0.31, abs=0.04)
    assert result.clock_offset_s == pytest.approx(95.0, abs=15)
    assert result.r_fit > 0.99
    assert result.at_edge == ()
    assert result.candidates["r"].max() == result.r_fit


def test_records_outside_the_fitting_part_have_no_say():
    parts = split(
        [str(k) for k in range(20)], pd.date_range("2023-08-10", periods=len(RECORD_S), tz="UTC")
    )
    measured = records(0.25, 0.0, 0.0)
    measured[parts.reporting] = np.random.default_rng(1).uniform(0, 1600, parts.reporting.sum())
    options = {"clock_range_s": 0.0, "shift_range_m": 0.5}
    result = register(
        measured,
        RECORD_S,
        lambda shifts: shadows(shifts, FINE_S),
        FINE_S,
        fitting=parts.fitting,
        **options,
    )
    assert (result.east_m, result.north_m) == pytest.approx((0.25, 0.0), abs=0.04)
    assert result.n_fit == parts.fitting.sum()


def test_missing_records_are_left_out():
    measured = records(0.25, 0.0, 0.0)
    measured[::2] = np.nan
    result = register(
        measured,
        RECORD_S,
        lambda shifts: shadows(shifts, FINE_S),
        FINE_S,
        clock_range_s=0.0,
        shift_range_m=0.5,
    )
    assert (result.east_m, result.north_m) == pytest.approx((0.25, 0.0), abs=0.04)
    assert result.n_fit == np.isfinite(measured).sum()


def test_a_truth_beyond_the_range_is_reported_as_an_edge():
    result = register(
        records(0.6, 0.0, 0.0),
        RECORD_S,
        lambda shifts: shadows(shifts, FINE_S),
        FINE_S,
        shift_range_m=0.5,
        clock_range_s=0.0,
    )
    assert result.at_edge == ("east_m",)


def test_a_simulation_that_is_too_short_for_the_clock_range_is_an_error():
    with pytest.raises(InputError, match="times that cover -900"):
        register(
            records(0, 0, 0), RECORD_S, lambda s: shadows(s, FINE_S), FINE_S, clock_range_s=900
        )


def test_constant_light_cannot_be_registered():
    with pytest.raises(InputError, match="no candidate with a defined r"):
        register(
            np.full((20, len(RECORD_S)), 100.0),
            RECORD_S,
            lambda s: np.ones((len(s), 20, len(FINE_S))),
            FINE_S,
        )


def test_sensors_are_split_into_two_named_parts():
    parts = split(["1_1", "1_2", "2_1"], pd.date_range("2023-08-10", periods=5, tz="UTC"), seed=4)
    assert np.array_equal(parts.fitting, ~parts.reporting)
    assert parts.fitting.all(axis=1).sum() == 1
    assert parts.fitting_part.startswith("1 of 3 sensors: ")
    named = [part.split(": ")[1].split(", ") for part in (parts.fitting_part, parts.reporting_part)]
    assert sorted(named[0] + named[1]) == ["1_1", "1_2", "2_1"]


def test_times_are_split_into_before_and_after():
    times = pd.date_range("2023-08-10 10:00", periods=4, freq="h", tz="UTC")
    parts = split(["1_1", "1_2"], times, by="time", share=0.5)
    assert parts.fitting.tolist() == [[True, True, False, False]] * 2
    assert parts.fitting_part == "times up to 2023-08-10 11:00 UTC"
    assert parts.reporting_part == "times from 2023-08-10 12:00 UTC"


@pytest.mark.parametrize("share", [0.0, 0.01, 1.0])
def test_a_split_that_leaves_nothing_to_report_or_to_fit_is_an_error(share):
    with pytest.raises(InputError, match="leaves one part empty"):
        split(["1_1", "1_2"], pd.date_range("2023-08-10", periods=4, tz="UTC"), share=share)


def test_the_gain_is_that_of_sensors_in_full_sun():
    """Shade that the simulation does not know, half-shade and other sensors have no say."""
    rng = np.random.default_rng(3)
    simulated = rng.uniform(1000, 1500, (4, 100))
    measured = 0.95 * simulated * rng.normal(1, 0.01, simulated.shape)
    measured[0, :40] = 200.0
    measured[1] = np.nan
    sunlit = np.ones_like(simulated)
    sunlit[2], measured[2] = 0.5, 2 * simulated[2]
    found = open_sky_gain(measured, simulated, sunlit)
    assert found["gain"] == pytest.approx(0.95, abs=0.003)
    assert found["n_gain"] == 160


def test_sensors_that_never_see_the_sun_tell_no_gain():
    with pytest.raises(InputError, match=r"registration\.gain.*full sun"):
        open_sky_gain(np.full((2, 50), 100.0), np.full((2, 50), 900.0), np.zeros((2, 50)))
