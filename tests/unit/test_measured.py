import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.formats.netcdf import time_coordinate
from dapple.stats import measured
from dapple.times import time_range

TIMES = time_range("2023-08-10 10:00", "2023-08-10 13:20", 1, "UTC")


def light(par, labels=("1_1",), times=TIMES):
    attrs = {"units": "umol m-2 s-1", "long_name": "PAR"}
    values = np.broadcast_to(np.asarray(par, float), (len(labels), len(times)))
    return xr.Dataset(
        {"par_umol_m2_s": (("sensor", "time"), values, attrs)},
        {"sensor": list(labels), "time": time_coordinate(times)},
    )


def records(tmp_path, text):
    path = tmp_path / "par.csv"
    path.write_text("time_utc,channel,logger,par_umolm2s\n" + text)
    return path


def test_logger_and_channel_make_the_label_and_times_are_utc(tmp_path):
    path = records(
        tmp_path,
        "2023-08-10 10:11:00,3,1,120\n2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:30,1,2,900\n",
    )
    read = measured.read(path)
    assert read.columns.tolist() == measured.COLUMNS
    assert read["sensor"].tolist() == ["1_3", "1_3", "2_1"]
    assert read["par_umol_m2_s"].tolist() == [100, 120, 900]
    assert read["time"].iloc[0] == pd.Timestamp("2023-08-10 10:10", tz="UTC")


def test_a_repeated_row_counts_once_and_an_empty_one_not_at_all(tmp_path):
    path = records(
        tmp_path,
        "2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:00,3,1,100\n2023-08-10 10:11:00,3,1,\n",
    )
    assert len(measured.read(path)) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:00,3,1,101\n",
            "two values of sensor 1_3 at 2023-08-10 10:10",
        ),
        ("2023-08-10 10:10:00,3,1,30656\n", "30656 µmol"),
        ("", "no record"),
        ("10.8.2023,3,1,100\n", "ISO 8601"),
    ],
)
def test_broken_records_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        measured.read(records(tmp_path, text))


def test_missing_files_columns_and_time_zones_are_refused(tmp_path):
    with pytest.raises(InputError, match="no file"):
        measured.read(tmp_path / "none.csv")
    path = tmp_path / "par.csv"
    path.write_text("sensor,time,par\n1_3,2023-08-10 10:10:00,5\n")
    with pytest.raises(InputError, match="columns par_umolm2s, time_utc"):
        measured.read(path)
    with pytest.raises(InputError, match="naive timestamp"):
        measured.read(path, time_column="time", par_column="par")
    read = measured.read(path, time_column="time", par_column="par", timezone="Europe/Berlin")
    assert read["time"].dt.hour.tolist() == [8]


def test_a_sensor_without_a_position_is_listed(tmp_path):
    path = records(tmp_path, "2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:00,5,9,100\n")
    positions = pd.DataFrame({"sensor": ["1_3"], "x_m": [0.0], "y_m": [0.0], "z_m": [0.0]})
    with pytest.raises(InputError, match="1 sensors without a position: 9_5"):
        measured.read(path, sensors=positions)


def test_coverage_counts_the_records_that_are_missing(tmp_path):
    minutes = (0, 1, 2, 5, 6, 7)
    text = "".join(f"2023-08-10 10:{minute:02d}:00,3,1,100\n" for minute in minutes)
    row = measured.coverage(measured.read(records(tmp_path, text))).iloc[0]
    assert (row["n"], row["step_s"], row["missing"], row["longest_gap_s"]) == (6, 60.0, 2, 180.0)


def test_a_perfect_sensor_records_the_light_itself():
    truth = light(np.linspace(0, 1000, len(TIMES)))
    got = measured.simulate(truth, noise_relative=0.0, noise_umol_m2_s=0.0, seed=1)
    assert got["par_umol_m2_s"].to_numpy() == pytest.approx(truth["par_umol_m2_s"].to_numpy()[0])
    assert got["time"].tolist() == TIMES.tolist()


def test_a_clock_that_is_ahead_stamps_light_of_the_past():
    ramp = light(np.arange(len(TIMES)))  # 1 µmol m⁻² s⁻¹ more every minute
    silent = {"noise_relative": 0.0, "noise_umol_m2_s": 0.0, "seed": 1}
    late = measured.simulate(ramp, clock_offset_s=90.0, **silent)
    assert late["par_umol_m2_s"].iloc[0] == pytest.approx(0.5)
    assert late["time"].iloc[0] == TIMES[2]
    assert np.diff(late["par_umol_m2_s"]) == pytest.approx(1.0)
    early = measured.simulate(ramp, clock_offset_s=-90.0, **silent)
    assert early["time"].iloc[-1] == TIMES[-3]


def test_noise_has_the_asked_size_and_no_bias():
    got = measured.simulate(
        light(1000.0, [str(k) for k in range(50)]),
        noise_relative=0.02,
        noise_umol_m2_s=15.0,
        seed=4,
    )["par_umol_m2_s"]
    assert got.mean() == pytest.approx(1000.0, abs=4 * 25 / np.sqrt(len(got)))
    assert got.std() == pytest.approx(25.0, rel=0.05)  # √(20² + 15²)


def test_a_calibration_error_is_the_same_in_all_records_of_a_sensor():
    got = measured.simulate(
        light(1000.0, [str(k) for k in range(200)]),
        noise_relative=0.0,
        noise_umol_m2_s=0.0,
        calibration_relative=0.05,
        seed=4,
    ).groupby("sensor")["par_umol_m2_s"]
    assert got.std().max() == pytest.approx(0.0, abs=1e-9)
    assert got.mean().std() == pytest.approx(50.0, rel=0.2)


def test_in_the_dark_no_record_is_negative():
    assert measured.simulate(light(0.0), seed=1)["par_umol_m2_s"].min() == 0.0


def test_the_noise_of_a_sensor_depends_on_its_label_and_the_seed_alone():
    both = measured.simulate(light(500.0, ["1_1", "1_2"]), seed=7)
    alone = measured.simulate(light(500.0, ["1_2"]), seed=7)
    second = both[both["sensor"] == "1_2"].reset_index(drop=True)
    pd.testing.assert_frame_equal(second, alone)
    other = measured.simulate(light(500.0, ["1_2"]), seed=8)
    assert (other["par_umol_m2_s"] != alone["par_umol_m2_s"]).all()
