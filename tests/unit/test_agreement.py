"""The fast engine against the reference."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.stats import agreement

TIMES = pd.date_range("2023-08-10 10:00", periods=4, freq="h")
OPEN_SKY = xr.DataArray([500.0, 1000.0, 2000.0, 0.0], {"time": TIMES}, "time")


def light(par, standard_error=1.0, sensors=("1_1", "1_2")):
    shape = (len(sensors), len(TIMES))
    values = {
        "par_umol_m2_s": (("sensor", "time"), np.broadcast_to(par, shape)),
        "standard_error_umol_m2_s": (("sensor", "time"), np.full(shape, standard_error)),
    }
    return xr.Dataset(values, {"sensor": list(sensors), "time": TIMES})


def test_an_excess_of_one_percent_of_the_open_sky_is_a_bias_of_one_percent():
    fast = light(100 + 0.01 * OPEN_SKY.to_numpy())
    result = agreement.compare(fast, light(100.0), OPEN_SKY)
    assert result["bias_rel"] == pytest.approx(0.01)
    assert result["rmse_rel"] == pytest.approx(0.01)


def test_night_does_not_count():
    assert agreement.compare(light(5.0), light(0.0), OPEN_SKY)["n"] == 6


def test_a_run_of_nights_alone_has_nothing_to_compare_and_is_no_error():
    row = agreement.compare(light(0.0), light(0.0), 0.0 * OPEN_SKY)
    assert row.pop("n") == 0
    assert np.isnan(list(row.values())).all()


def test_z_is_the_difference_over_the_joint_standard_error():
    result = agreement.compare(light(110.0, 3.0), light(100.0, 4.0), OPEN_SKY)
    assert result["max_abs_z"] == pytest.approx(2.0, rel=1e-5)


def test_engines_without_noise_may_differ_in_the_last_digit_only():
    close = agreement.compare(light(100.0 + 1e-4, 0.0), light(100.0, 0.0), OPEN_SKY)
    far = agreement.compare(light(101.0, 0.0), light(100.0, 0.0), OPEN_SKY)
    assert close["max_abs_z"] < 1
    assert far["max_abs_z"] > 100


def test_only_common_sensors_are_compared():
    reference = light(100.0, sensors=("1_2", "9_9"))
    assert agreement.compare(light(100.0), reference, OPEN_SKY)["n"] == 3


def test_nothing_in_common_is_an_error():
    with pytest.raises(InputError, match="0 common sensors"):
        agreement.compare(light(1.0), light(1.0, sensors=("9_9",)), OPEN_SKY)


def test_the_table_has_the_columns_that_others_rely_on():
    row = agreement.compare(light(1.0), light(1.0), OPEN_SKY)
    engines = {"engine": "transport", "reference": "less"}
    table = agreement.table([{"reconstruction": "polygons"} | row | engines])
    assert list(table)[:5] == ["reconstruction", "n", "rmse_rel", "bias_rel", "max_abs_z"]
    assert table.loc[0, ["engine", "reference"]].tolist() == ["transport", "less"]


def test_engines_that_trace_with_mitsuba_are_said_to_share_its_ray_tracer():
    pairs = [("transport", "timestep"), ("transport", "less"), ("timestep", "less")]
    table = agreement.table([{"engine": one, "reference": other} for one, other in pairs])
    assert table["shared"].str.contains("ray tracer").tolist() == [True, False, False]


def test_an_error_is_relative_to_the_open_sky_of_its_own_time_and_the_night_does_not_count():
    open_sky = np.array([1000.0, 100.0, 0.0])
    reference = np.zeros((2, 3))
    par = np.array([[100.0, 10.0, 5.0], [-100.0, -10.0, 5.0]])
    assert agreement.rmse_rel(par, reference, open_sky) == pytest.approx(0.1)
