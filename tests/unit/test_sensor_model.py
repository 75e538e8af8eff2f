import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.formats.netcdf import time_coordinate
from dapple.times import time_range
from dapple.virtual.sensor_model import simulate

TIMES = time_range("2023-08-10 10:00", "2023-08-10 13:20", 1, "UTC")


def light(par, labels=("1_1",), times=TIMES):
    attrs = {"units": "umol m-2 s-1", "long_name": "PAR"}
    values = np.broadcast_to(np.asarray(par, float), (len(labels), len(times)))
    return xr.Dataset(
        {"par_umol_m2_s": (("sensor", "time"), values, attrs)},
        {"sensor": list(labels), "time": time_coordinate(times)},
    )


def test_a_perfect_sensor_records_the_light_itself():
    truth = light(np.linspace(0, 1000, len(TIMES)))
    got = simulate(truth, noise_relative=0.0, noise_umol_m2_s=0.0, seed=1)
    assert got["par_umol_m2_s"].to_numpy() == pytest.approx(truth["par_umol_m2_s"].to_numpy()[0])
    assert got["time"].tolist() == TIMES.tolist()


def test_a_clock_that_is_ahead_stamps_light_of_the_past():
    ramp = light(np.arange(len(TIMES)))  # 1 µmol m⁻² s⁻¹ more every minute
    silent = {"noise_relative": 0.0, "noise_umol_m2_s": 0.0, "seed": 1}
    late = simulate(ramp, clock_offset_s=90.0, **silent)
    assert late["par_umol_m2_s"].iloc[0] == pytest.approx(0.5)
    assert late["time"].iloc[0] == TIMES[2]
    assert np.diff(late["par_umol_m2_s"]) == pytest.approx(1.0)
    early = simulate(ramp, clock_offset_s=-90.0, **silent)
    assert early["time"].iloc[-1] == TIMES[-3]


def test_noise_has_the_asked_size_and_no_bias():
    got = simulate(
        light(1000.0, [str(k) for k in range(50)]),
        noise_relative=0.02,
        noise_umol_m2_s=15.0,
        seed=4,
    )["par_umol_m2_s"]
    assert got.mean() == pytest.approx(1000.0, abs=4 * 25 / np.sqrt(len(got)))
    assert got.std() == pytest.approx(25.0, rel=0.05)  # √(20² + 15²)


def test_a_calibration_error_is_the_same_in_all_records_of_a_sensor():
    got = simulate(
        light(1000.0, [str(k) for k in range(200)]),
        noise_relative=0.0,
        noise_umol_m2_s=0.0,
        calibration_relative=0.05,
        seed=4,
    ).groupby("sensor")["par_umol_m2_s"]
    assert got.std().max() == pytest.approx(0.0, abs=1e-9)
    assert got.mean().std() == pytest.approx(50.0, rel=0.2)


def test_in_the_dark_no_record_is_negative():
    assert simulate(light(0.0), seed=1)["par_umol_m2_s"].min() == 0.0


def test_the_noise_of_a_sensor_depends_on_its_label_and_the_seed_alone():
    both = simulate(light(500.0, ["1_1", "1_2"]), seed=7)
    alone = simulate(light(500.0, ["1_2"]), seed=7)
    second = both[both["sensor"] == "1_2"].reset_index(drop=True)
    pd.testing.assert_frame_equal(second, alone)
    other = simulate(light(500.0, ["1_2"]), seed=8)
    assert (other["par_umol_m2_s"] != alone["par_umol_m2_s"]).all()
