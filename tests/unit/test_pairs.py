"""Records that are means over an interval, against simulated light that changes within it."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.stats.pairs import interval_means, pair

START = pd.Timestamp("2023-07-01T12:00", tz="UTC")


def light(values, step_s):
    """Light of sensors (sensor, time) at times from noon on; a third of it is direct."""
    values = np.asarray(values, float)
    times = START.tz_localize(None) + pd.to_timedelta(np.arange(values.shape[1]) * step_s, unit="s")
    names = [f"1_{k + 1}" for k in range(len(values))]
    parts = {"par_umol_m2_s": values, "par_direct_umol_m2_s": values / 3}
    return xr.Dataset(
        {name: (("sensor", "time"), part) for name, part in parts.items()},
        {"sensor": names, "time": times.to_numpy()},
    )


def records(sensor, middles_s, interval_s, values=1.0):
    """Of one sensor; the middles of their intervals [s after noon]."""
    times = START + pd.to_timedelta(np.asarray(middles_s, float), unit="s")
    return pd.DataFrame(
        {
            "sensor": sensor,
            "time": times,
            "par_umol_m2_s": values,
            "interval_s": np.broadcast_to(float(interval_s), len(times)),
        }
    )


def test_the_mean_of_a_rising_line_is_its_value_in_the_middle():
    times = np.array([0.0, 60.0, 120.0, 180.0])
    first, last = np.array([0.0, 30.0, 45.0]), np.array([180.0, 90.0, 50.0])
    found = interval_means(times, 5.0 + 2.0 * times, first, last)
    assert found == pytest.approx(5.0 + (first + last))


def test_the_mean_over_a_peak_is_that_of_its_two_slopes():
    times, values = np.array([0.0, 60.0, 120.0]), np.array([0.0, 600.0, 0.0])
    found = interval_means(times, values, np.array([0.0, 30.0]), np.array([120.0, 120.0]))
    assert found == pytest.approx([300.0, (60 * 600 - 0.5 * 30 * 300) / 90])


def test_steps_of_unequal_length_count_by_their_length():
    times, values = np.array([0.0, 10.0, 100.0]), np.array([90.0, 0.0, 0.0])
    assert interval_means(times, values, np.zeros(1), np.array([100.0])) == pytest.approx(4.5)


def test_a_record_over_an_interval_is_held_against_the_mean_of_the_light_in_it():
    """Two sensors whose light goes up and stays: each record has its own sensor's mean."""
    simulated = light([[0, 60, 120, 180, 240], [7, 7, 7, 7, 7]], step_s=60)
    taken = pd.concat([records("1_2", [90, 150], 60, 3.0), records("1_1", [60, 150], 120, 4.0)])
    found = pair(simulated, taken, reconstruction="x").set_index("sensor")
    assert found.loc["1_1", "simulated"].tolist() == pytest.approx([60.0, 150.0])
    assert found.loc["1_1", "direct"].tolist() == pytest.approx([20.0, 50.0])
    assert found.loc["1_2", "simulated"].tolist() == pytest.approx([7.0, 7.0])
    assert found.loc["1_2", "measured"].tolist() == [3.0, 3.0]


def test_intervals_that_reach_beyond_the_simulated_times_are_left_out():
    simulated = light([[0, 60, 120, 180, 240]], step_s=60)
    found = pair(simulated, records("1_1", [-30, 30, 210, 211, 270], 60), reconstruction="x")
    assert found["simulated"].tolist() == pytest.approx([30.0, 210.0])


def test_a_clock_that_is_ahead_is_put_back():
    simulated = light([[0, 60, 120, 180, 240]], step_s=60)
    late = records("1_1", [150], 60)
    found = pair(simulated, late, reconstruction="x", clock_offset_s=60.0)
    assert found["simulated"].tolist() == pytest.approx([90.0])


def test_a_record_shorter_than_a_step_is_held_against_the_nearest_time():
    simulated = light([[0, 60, 120, 180, 240]], step_s=60)
    found = pair(simulated, records("1_1", [70.0], 10), reconstruction="x")
    assert found["simulated"].tolist() == [60.0]


def test_an_open_sky_is_averaged_over_the_same_interval():
    simulated = light([[0, 60, 120, 180, 240]], step_s=60)
    above = xr.DataArray(
        np.array([0.0, 100.0, 200.0, 300.0, 400.0]), {"time": simulated["time"]}, ("time",)
    )
    found = pair(simulated, records("1_1", [90.0], 60), above, reconstruction="x")
    assert found["baseline"].tolist() == pytest.approx([150.0])
