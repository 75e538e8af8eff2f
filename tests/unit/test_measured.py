"""PAR records as loggers write them: labels, units, intervals, what is left out."""

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.stats import measured, plausible_records


def records(tmp_path, text):
    path = tmp_path / "par.csv"
    path.write_text("time_utc,channel,logger,par_umolm2s\n" + text)
    return path


def places(*labels, **columns):
    zeros = dict.fromkeys(("x_m", "y_m", "z_m"), 0.0)
    return pd.DataFrame({"sensor": labels} | columns).assign(**zeros)


def test_logger_and_channel_make_the_label_and_times_are_utc(tmp_path):
    path = records(
        tmp_path,
        "2023-08-10 10:11:00,3,1,120\n2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:30,1,2,900\n",
    )
    read = measured.read(path).table
    assert read["sensor"].tolist() == ["1_3", "1_3", "2_1"]
    assert read["par_umol_m2_s"].tolist() == [100, 120, 900]
    assert read["time"].iloc[0] == pd.Timestamp("2023-08-10 10:10", tz="UTC")
    assert (read["interval_s"] == 0).all()


def test_a_repeated_row_counts_once_an_empty_one_not_at_all_and_both_are_said(tmp_path):
    path = records(
        tmp_path,
        "2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:00,3,1,100\n"
        "2023-08-10 10:11:00,3,1,\n2023-08-10 10:12:00,3,1,-9999\n",
    )
    read = measured.read(path)
    assert len(read.table) == 1
    said = " ".join(map(str, read.findings))
    assert "1 records twice" in said
    assert "2 values of par_umolm2s missing (1 empty, 1 × '-9999')" in said


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:00,3,1,101\n",
            "two values of sensor 1_3 at 2023-08-10 10:10",
        ),
        ("2023-08-10 10:10:00,3,1,30656\n", "line 2: found 30656 µmol"),
        ("2023-08-10 10:10:00,3,1,dark\n", "line 2: found 'dark'"),
        ("", "no record"),
        ("10.8.2023,3,1,100\n", "a day without a time"),
    ],
)
def test_broken_records_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        measured.read(records(tmp_path, text))


def test_missing_files_columns_and_time_zones_are_refused(tmp_path):
    with pytest.raises(InputError, match="no file"):
        measured.read(tmp_path / "none.csv")
    path = tmp_path / "par.csv"
    path.write_text("sensor,when,light\n1_3,2023-08-10 10:10:00,5\n")
    with pytest.raises(InputError, match=r"Name the column in `measured.par_column`"):
        measured.read(path)
    columns = {"time_column": "when", "par_column": "light"}
    with pytest.raises(InputError, match="naive timestamp"):
        measured.read(path, **columns)
    read = measured.read(path, **columns, timezone="Europe/Berlin").table
    assert read["time"].dt.hour.tolist() == [8]


def test_a_sensor_without_a_position_is_listed(tmp_path):
    path = records(tmp_path, "2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:00,5,9,100\n")
    with pytest.raises(InputError, match="1 sensors without a position: 9_5"):
        measured.read(path, sensors=places("1_3"))


def test_thousands_are_read_and_not_dropped(tmp_path):
    path = tmp_path / "par.csv"
    path.write_text(
        'sensor,time_utc,par\na,2023-08-10 10:00,998\na,2023-08-10 10:10,"1,204"\n'
        'a,2023-08-10 10:20,"1,530"\n'
    )
    assert measured.read(path).table["par_umol_m2_s"].tolist() == [998, 1204, 1530]


def test_a_wide_table_has_a_column_for_each_sensor(tmp_path):
    path = tmp_path / "toa5.dat"
    path.write_text(
        '"TOA5","CR1000X","CR1000X","0","Std.06","CPU:par.CR1X","0","Min60"\n'
        '"TIMESTAMP","RECORD","PAR_W3_Avg","PAR_E13_Avg"\n'
        '"TS","RN","umol/m2/s","umol/m2/s"\n"","","Avg","Avg"\n'
        '"2023-08-10 10:00:00",1,"NAN",400.5\n"2023-08-10 10:10:00",2,300,401\n'
    )
    read = measured.read(path, sensors=places("W3", "E13", "N1"), timezone="+01:00").table
    assert read["sensor"].tolist() == ["W3", "E13", "E13"]
    assert read["par_umol_m2_s"].tolist() == [300, 400.5, 401]
    assert read["time"].iloc[0] == pd.Timestamp("2023-08-10 09:10", tz="UTC")


def test_the_temperature_of_a_sensor_is_not_its_light(tmp_path):
    path = tmp_path / "wide.csv"
    path.write_text("time_utc,PAR_a_Avg,T_a_Avg\n2023-08-10 10:00,300,21\n")
    read = measured.read(path, sensors=places("a")).table
    assert read["par_umol_m2_s"].tolist() == [300]


def test_two_columns_for_one_sensor_need_a_pattern(tmp_path):
    path = tmp_path / "wide.csv"
    path.write_text("time_utc,PAR_a_Avg,PAR_a_Max\n2023-08-10 10:00,300,400\n")
    with pytest.raises(InputError, match="PAR_a_Avg and PAR_a_Max for sensor a"):
        measured.read(path, sensors=places("a"))
    read = measured.read(path, sensors=places("a"), par_column="PAR_{sensor}_Max").table
    assert read["par_umol_m2_s"].tolist() == [400]


def test_the_one_of_a_unit_is_no_label(tmp_path):
    path = tmp_path / "wide.csv"
    path.write_text(
        "time_utc,PAR 1 [µmol m-2 s-1],PAR 2 [µmol m-2 s-1]\n2023-08-10 10:00,300,400\n"
    )
    read = measured.read(path, sensors=places("1", "2")).table
    assert read["par_umol_m2_s"].tolist() == [300, 400]


def test_a_file_for_each_sensor_is_known_by_its_label_or_its_name(tmp_path):
    title = '"Plot Title: plot"\n"#","Date Time, GMT+01:00","PAR, uE (LGR S/N: 1, SEN S/N: 2'
    row = "1,08/13/23 01:10:00 PM,512.5\n2,08/13/23 01:20:00 PM,\n"
    labelled, named = tmp_path / "hobo.csv", tmp_path / "hobo_E3.csv"
    labelled.write_text(f'{title}, LBL: W3)"\n{row}')
    named.write_text(f'{title})"\n{row}')
    read = measured.read([labelled, named], sensors=places("W3", "E3")).table
    assert read["sensor"].tolist() == ["W3", "E3"]
    assert (read["time"] == pd.Timestamp("2023-08-13 12:10", tz="UTC")).all()


def test_units_are_taken_from_header_or_key_and_sums_need_their_interval(tmp_path):
    path = tmp_path / "par.csv"
    path.write_text("sensor,time_utc,PAR [mol m-2]\na,2023-08-10 10:00,1.8\n")
    column = {"par_column": "PAR [mol m-2]"}
    with pytest.raises(InputError, match="`interval_min`"):
        measured.read(path, **column)
    hourly = {"interval_label": "end", "interval_min": 60}
    read = measured.read(path, **column, **hourly).table
    assert read["par_umol_m2_s"].tolist() == pytest.approx([500.0])
    assert read["time"].iloc[0] == pd.Timestamp("2023-08-10 09:30", tz="UTC")
    path.write_text("sensor,time_utc,par [klx]\na,2023-08-10 10:00,30\n")
    with pytest.raises(InputError, match="unit 'klx'"):
        measured.read(path)
    path.write_text("sensor,time_utc,par\na,2023-08-10 10:00,100\n")
    warm = measured.read(path, unit="W/m2")
    assert warm.table["par_umol_m2_s"].tolist() == pytest.approx([457.0])
    assert any("PAR in W m" in one.found for one in warm.findings)


def test_sensors_may_have_different_steps_and_each_its_own_interval(tmp_path):
    rows = [f"a,2023-08-10 10:{m:02d},1" for m in range(0, 60, 10)]
    rows += [f"b,2023-08-10 10:{m:02d},1" for m in range(0, 60, 15)]
    path = tmp_path / "par.csv"
    path.write_text("sensor,time_utc,par\n" + "\n".join(rows))
    read = measured.read(path, interval_label="end").table
    assert read.groupby("sensor")["interval_s"].unique().map(list).to_dict() == {
        "a": [600.0],
        "b": [900.0],
    }
    assert read["time"].dt.minute.iloc[0] == 55


def test_calibration_factors_of_the_sensor_table_multiply_records(tmp_path):
    path = records(tmp_path, "2023-08-10 10:10:00,3,1,100\n2023-08-10 10:10:00,5,9,100\n")
    table = places("1_3", "9_5", calibration=[1.1, 1.0])
    read = measured.read(path, sensors=table).table
    assert read["par_umol_m2_s"].tolist() == pytest.approx([110.0, 100.0])


# --- against simulated light ------------------------------------------------------------------


def fleck_light(shift_min=0.0, factor=1.0, step_min=10):
    """Pairs and records of three sensors that a beam crosses in turn."""
    minutes = np.arange(0, 600, step_min, dtype=float)

    def at(minute, k):
        return 900.0 * np.exp(-(((minute - 150 - 120 * k) / 60) ** 2)) + 50.0

    times = pd.Timestamp("2023-08-10 07:00", tz="UTC") + pd.to_timedelta(minutes, unit="min")
    series = [
        pd.DataFrame({"sensor": str(k), "time": times, "simulated": at(minutes, k),
                      "measured": factor * at(minutes - shift_min, k)})
        for k in range(3)
    ]  # fmt: skip
    pairs = pd.concat(series).assign(reconstruction="polygons", baseline=1500.0)
    return pairs, pairs.rename(columns={"measured": "par_umol_m2_s"})


def test_records_in_step_raise_no_doubt():
    assert plausible_records.check(*fleck_light()) == []


def test_records_that_lag_are_named_with_the_lag():
    (doubt,) = plausible_records.check(*fleck_light(shift_min=30.0))
    assert doubt.level == "warning"
    assert "light of 30 min earlier" in doubt.found


def test_records_in_another_unit_are_named_with_it():
    (doubt,) = plausible_records.check(*fleck_light(factor=1 / 4.57))
    assert "fits W/m2" in doubt.remedy
    (doubt,) = plausible_records.check(*fleck_light(factor=1e-3))
    assert "fits mmol/m2/s" in doubt.remedy
