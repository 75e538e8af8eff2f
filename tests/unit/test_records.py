"""Pairing simulated and measured light."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.stats.pairs import pair

TIMES = pd.date_range("2023-08-10 10:00", periods=3, freq="10min")


def light():
    par = np.array([[10.0, 20.0, 30.0], [40.0, 50.0, 60.0]])
    dims = ("sensor", "time")
    values = {"par_umol_m2_s": (dims, par), "par_direct_umol_m2_s": (dims, par / 2)}
    return xr.Dataset(values, {"sensor": ["1_1", "2_1"], "time": TIMES})


def measured(shift_s=0):
    """Records every minute whose value is the minute."""
    times = pd.date_range("2023-08-10 10:00", periods=30, freq="min", tz="UTC")
    values = {"sensor": "1_1", "time": times + pd.Timedelta(seconds=shift_s)}
    return pd.DataFrame(values | {"par_umol_m2_s": np.arange(30.0)})


def test_each_simulated_time_takes_the_record_of_that_time():
    records = pair(light(), measured(), reconstruction="polygons")
    assert records["measured"].to_list() == [0, 10, 20]
    assert records["simulated"].to_list() == [10, 20, 30]
    assert records["direct"].to_list() == [5, 10, 15]
    assert str(records["time"].iloc[0]) == "2023-08-10 10:00:00+00:00"
    assert set(records["reconstruction"]) == {"polygons"}


def test_a_logger_that_writes_at_half_past_is_within_reach_and_one_farther_off_is_not():
    assert len(pair(light(), measured(30), reconstruction="p")) == 3
    with pytest.raises(InputError, match="no record within 5 s"):
        pair(light(), measured(30), reconstruction="p", tolerance_s=5)


def test_a_clock_that_is_ahead_is_set_back():
    ahead = measured(shift_s=120)
    records = pair(light(), ahead, reconstruction="p", clock_offset_s=120)
    assert records["measured"].to_list() == [0, 10, 20]


def test_the_baseline_is_the_open_sky_of_that_time():
    sky = xr.DataArray([1500.0, 1600.0, 1700.0], {"time": TIMES}, "time")
    records = pair(light(), measured(), sky, reconstruction="p")
    assert records["baseline"].to_list() == [1500, 1600, 1700]


def test_labels_that_do_not_match_are_an_error_that_counts_them():
    with pytest.raises(InputError, match="0 sensors in common"):
        pair(light(), measured().assign(sensor="x"), reconstruction="p")


def test_naive_times_are_an_error():
    naive = measured().assign(time=lambda d: d["time"].dt.tz_localize(None))
    with pytest.raises(InputError, match="naive times"):
        pair(light(), naive, reconstruction="p")
