"""Radiation tables: read, split, spread over their intervals, and filled where they have gaps."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pvlib
import pytest
from tests.unit.weather import FREIBURG, minutes, station

from dapple.errors import InputError
from dapple.sky import radiation_series, radiation_table, sun
from dapple.times import time_range

AFTERNOON = time_range("2023-08-10 10:10", "2023-08-10 16:50", 10, "UTC")


def table_file(tmp_path, rows, header="time_utc,global_W_m2,diffuse_W_m2"):
    path = tmp_path / "radiation.csv"
    path.write_text(f"{header}\n{rows}")
    return path


def at(path, times, **options):
    return radiation_series.at(radiation_table.read(path), times, FREIBURG, **options).values


# --- reading ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("2023-08-10 11:00,,90\n", "no row with a value"),
        ("2023-08-10 11:00,800,90\n2023-08-10 11:00,810,90\n", "two different values at"),
        ("2023-08-10 11:00,many,90\n", "line 2: found 'many'"),
        ("eleven,800,90\n", "ISO 8601"),
        ("", "no row with a value"),
    ],
)
def test_a_broken_table_is_refused(tmp_path, rows, message):
    with pytest.raises(InputError, match=message):
        radiation_table.read(table_file(tmp_path, rows))


def test_a_table_in_local_time_needs_its_zone(tmp_path):
    path = table_file(tmp_path, "2023-08-10 13:00,800,90\n", "time,global_W_m2,diffuse_W_m2")
    with pytest.raises(InputError, match="naive timestamp"):
        radiation_table.read(path)
    table = radiation_table.read(path, timezone="Europe/Berlin").table
    assert table.index[0] == pd.Timestamp("2023-08-10 11:00", tz="UTC")
    with pytest.raises(InputError, match=r"Name the column in `radiation.time_column`"):
        radiation_table.read(path, time_column="stamp", timezone="UTC")


def test_what_is_missing_or_twice_is_left_out_and_said(tmp_path):
    rows = "2023-08-10 11:00,800,90\n2023-08-10 11:00,800,90\n2023-08-10 11:10,-999,-999\n"
    read = radiation_table.read(table_file(tmp_path, rows + "2023-08-10 11:20,790,NAN\n"))
    assert read.table["global_w_m2"].tolist() == [800, 790]
    said = " ".join(map(str, read.findings))
    assert "1 values of global_W_m2 missing (1 × '-999')" in said
    assert "1 × '-999', 1 × 'NAN'" in said
    assert "1 rows twice" in said
    assert (read.facts["rows"], read.facts["rows_used"]) == (4, 2)


def test_units_come_from_key_header_or_layout_and_sums_take_the_interval(tmp_path):
    rows = "2023-08-10 11:10,48,6\n2023-08-10 11:20,48,6\n"
    path = table_file(tmp_path, rows, "time_utc,global [J/cm2],diffuse [J/cm2]")
    read = radiation_table.read(path, interval_label="end")
    assert read.table.iloc[0].tolist() == pytest.approx([800.0, 100.0])  # over 600 s
    assert read.interval_min == 10.0
    path = table_file(tmp_path, rows, "time_utc,global,diffuse")
    declared = radiation_table.read(path, unit="J/cm2", interval_label="end", interval_min=10)
    assert declared.table.equals(read.table)
    path = table_file(tmp_path, rows, "time_utc,global [lx],diffuse [lx]")
    with pytest.raises(InputError, match="unit 'lx'"):
        radiation_table.read(path)


def test_ten_minute_sums_of_dwd_need_no_key(tmp_path):
    path = tmp_path / "produkt_zehn_min_sd_20230810.txt"
    path.write_text(
        "STATIONS_ID;MESS_DATUM;  QN;DS_10;GS_10;SD_10;LS_10;eor\n"
        "       1443;202308101110;    3;   6.0;  48.0;0.167;-999;eor\n"
        "       1443;202308101120;    3;-999;  47.4;0.167;-999;eor\n"
    )
    read = radiation_table.read(path)
    assert read.table["global_w_m2"].tolist() == pytest.approx([800.0, 790.0])
    assert (read.label, read.interval_min, read.facts["layout"]) == ("end", 10.0, "DWD")
    assert read.middles()[0] == pd.Timestamp("2023-08-10 11:05", tz="UTC")


# --- any time -----------------------------------------------------------------------------------


def test_samples_are_met_and_never_overshot_between_them(tmp_path):
    path = table_file(
        tmp_path,
        "2023-08-10 11:00,800,90\n2023-08-10 11:10,800,90\n2023-08-10 11:20,300,250\n"
        "2023-08-10 11:30,820,95\n",
    )
    got = at(path, time_range("2023-08-10 11:00", "2023-08-10 11:30", 1, "UTC"))
    assert got["global_w_m2"].iloc[[0, 10, 20, 30]].to_numpy() == pytest.approx(
        [800, 800, 300, 820]
    )
    assert got["global_w_m2"].between(300 - 1e-9, 820 + 1e-9).all()
    assert not got["modelled"].any()


def test_outside_and_in_gaps_of_a_table_the_model_joins_without_a_step(tmp_path):
    path = table_file(
        tmp_path,
        "2023-08-10 11:00,700,120\n2023-08-10 11:10,705,120\n"
        "2023-08-10 14:00,600,100\n2023-08-10 14:10,590,100\n",
    )
    got = at(path, time_range("2023-08-10 10:00", "2023-08-10 15:00", 1, "UTC"))
    minute = pd.Series(range(301), index=got.index)
    measured = minute.between(60, 70) | minute.between(240, 250)
    assert (got["modelled"] == ~measured).all()
    assert got["global_w_m2"].diff().abs().max() < 3  # a step at a seam would be of 40 or more
    # In the gap the day bends through its noon, above the straight line between its ends.
    assert (got["global_w_m2"] - np.interp(minute, [70, 240], [705, 600])).iloc[155] > 20


def test_weather_goes_over_from_the_last_row_before_a_gap_to_the_first_one_after_it(tmp_path):
    rows = "2023-08-10 11:00,700,120\n"
    rows += "".join(f"2023-08-10 14:{minute},200,180\n" for minute in ("00", "10", "20"))
    times = time_range("2023-08-10 11:00", "2023-08-10 14:00", 5, "UTC")
    got = at(table_file(tmp_path, rows), times)["global_w_m2"]
    share = (got / sun.clear_sky(times, FREIBURG)["global_w_m2"]).to_numpy()
    assert share[1] == pytest.approx(share[0], rel=0.1)
    assert share[-2] == pytest.approx(share[-1], rel=0.1)
    assert 1.2 * share[-1] < share[len(share) // 2] < share[0] / 1.2


@pytest.mark.parametrize(
    "rows",
    [
        "2023-08-10 04:30,27,1\n2023-08-10 04:40,40,2\n",  # ends at dawn
        "2023-08-10 18:30,14,1.6\n2023-08-10 18:45,0.9,0.1\n",  # begins at dusk
        "2023-08-10 04:30,27,1\n2023-08-10 04:40,40,2\n2023-08-10 18:30,14,1.6\n",
    ],
)
def test_a_low_sun_does_not_scale_the_day(tmp_path, rows):
    day = time_range("2023-08-10 03:00", "2023-08-10 20:00", 10, "UTC")
    clear = sun.clear_sky(day, FREIBURG)["global_w_m2"]
    series = radiation_series.at(radiation_table.read(table_file(tmp_path, rows)), day, FREIBURG)
    noon = slice("2023-08-10 08:00", "2023-08-10 16:00")
    assert series.values["global_w_m2"][noon].to_numpy() == pytest.approx(clear[noon].to_numpy())
    assert "a clear sky stands in" in series.findings[0].remedy
    assert series.facts["modelled_share_of_day"] > 0.9


def test_one_minute_of_cloud_at_the_end_does_not_darken_the_rest_of_the_day():
    truth = minutes(1, start="2023-08-10", clouds=False)
    morning = truth[:"2023-08-10 11:00"].copy()
    morning.loc["2023-08-10 10:59":] *= 0.2
    got = radiation_series.at(station(morning, 1, "instant"), AFTERNOON, FREIBURG).values
    after = got["2023-08-10 14:00":]["global_w_m2"] / truth["global_w_m2"].reindex(got.index)
    assert after.dropna().min() > 0.95


@pytest.mark.parametrize("label", ["start", "middle", "end"])
@pytest.mark.parametrize("step_min", [10, 15, 60])
def test_means_are_kept_when_they_are_spread_over_their_intervals(step_min, label):
    truth = minutes(2, start="2023-08-10")
    measured = station(truth, step_min, label)
    fine = radiation_series.at(measured, truth.index, FREIBURG).values
    again = station(fine[["global_w_m2", "diffuse_w_m2"]], step_min, label).table
    for name in again:
        sunny = measured.table[name] > 20
        ratio = again[name][sunny] / measured.table[name][sunny]
        assert ratio.to_numpy() == pytest.approx(1.0, abs=0.01)
    assert not fine["modelled"][step_min:-step_min].any()


def test_a_clear_day_comes_back_from_its_hourly_means():
    truth = minutes(1, start="2023-08-10", clouds=False)
    got = radiation_series.at(station(truth, 60, "end"), truth.index, FREIBURG).values
    assert np.abs(got["global_w_m2"] - truth["global_w_m2"]).max() < 2.0


def test_intervals_that_overlap_are_refused():
    truth = minutes(1, start="2023-08-10", clouds=False)
    running = replace(station(truth, 10, "end"), interval_min=60.0)
    with pytest.raises(InputError, match="means of 60 min"):
        radiation_series.at(running, AFTERNOON, FREIBURG)


@pytest.mark.parametrize("model", ["erbs", "dirint"])
def test_global_alone_is_split_by_a_model_and_said(model):
    truth = minutes(3, start="2023-08-10")
    alone = station(truth, 10, "middle", only_global=True)
    series = radiation_series.at(alone, AFTERNOON, FREIBURG, diffuse_model=model)
    known = radiation_series.at(station(truth, 10, "middle"), AFTERNOON, FREIBURG).values
    assert f"model `{model}`" in series.findings[0].remedy
    assert series.values["global_w_m2"].to_numpy() == pytest.approx(
        known["global_w_m2"].to_numpy(), rel=0.02
    )
    share = (series.values["diffuse_w_m2"] / series.values["global_w_m2"]).mean()
    assert share == pytest.approx((known["diffuse_w_m2"] / known["global_w_m2"]).mean(), abs=0.15)


# pvlib 0.16 still asks pandas for a day of the year by a name that it gives up.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_what_dirint_calls_direct_falls_on_the_level_with_the_cosine_of_the_sun():
    table = station(minutes(1, start="2023-08-10"), 60, "middle", only_global=True)
    zenith = sun.position(table.middles(), *FREIBURG.place)["sun_zenith_deg"].to_numpy()
    total = table.table["global_w_m2"].to_numpy()
    beam = pvlib.irradiance.dirint(
        total, zenith, table.middles(), pvlib.atmosphere.alt2pres(FREIBURG.altitude_m)
    )
    direct = total - radiation_series.split(table, FREIBURG, "dirint")
    is_day = (zenith < 85) & (beam > 100)
    assert is_day.sum() >= 6
    expected = np.asarray(beam)[is_day] * np.cos(np.radians(zenith[is_day]))
    assert direct[is_day] == pytest.approx(expected)


def test_a_table_of_another_day_is_refused(tmp_path):
    path = table_file(tmp_path, "2023-08-11 11:00,700,120\n2023-08-11 11:10,705,120\n")
    with pytest.raises(InputError, match="expected an overlap with the times"):
        radiation_series.broadband(AFTERNOON, FREIBURG, kind="table", path=path)


@pytest.mark.parametrize(
    ("step_min", "is_alike"), [(10, False), (15, True), (18, True), (60, False)]
)
def test_a_unit_that_looks_nearly_like_watts_is_named_where_none_is_stated(
    tmp_path, step_min, is_alike
):
    index = pd.date_range("2023-08-10 10:00", periods=4, freq=f"{step_min}min")
    for unit in ("", " [W/m2]"):
        rows = "".join(f"{time},500\n" for time in index)
        path = table_file(tmp_path, rows, header=f"time_utc,global{unit}")
        said = [one.found for one in radiation_table.read(path).findings]
        assert any("kJ/m2 over" in one for one in said) == (is_alike and not unit)


def test_an_implausible_table_can_be_reported_instead(tmp_path):
    truth = minutes(1, start="2023-08-10", clouds=False)
    table = station(truth, 60, "end", factor=1e-3).table
    path = tmp_path / "kwh.csv"
    table.rename_axis("time_utc").set_axis(["global", "diffuse"], axis="columns").to_csv(path)
    hourly = {"kind": "table", "path": path, "interval_label": "end"}
    with pytest.raises(InputError, match="kWh/m2"):
        radiation_series.broadband(AFTERNOON, FREIBURG, **hourly)
    series = radiation_series.broadband(AFTERNOON, FREIBURG, **hourly, implausible="report")
    assert [one.level for one in series.findings] == ["error"]
    right = radiation_series.broadband(AFTERNOON, FREIBURG, **hourly, unit="kWh/m2")
    assert right.values["global_w_m2"].max() == pytest.approx(853, abs=3)
