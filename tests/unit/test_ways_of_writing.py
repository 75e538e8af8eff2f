"""One clear day in many ways of writing: each is read as what it is, or refused with the remedy."""

import json

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.sky import radiation_table
from dapple.stats import measured

UTC = pd.date_range("2023-08-20 04:00", "2023-08-20 18:00", freq="30min", tz="UTC")
SUN = np.sin(np.pi * (np.arange(len(UTC)) + 0.5) / len(UTC))
GLOBAL, DIFFUSE = np.round(1200 * SUN, 1), np.round(90 * SUN, 1)
SENSORS = pd.DataFrame({"sensor": ["A1", "b2", "7"], "x_m": 0.0, "y_m": 0.0, "z_m": 0.0})


def lines(header, time, *columns, sep=",", zone="UTC", number=str):
    """A table of these times and numbers as text."""
    when = UTC.tz_convert(zone)
    stamps = [time(t) for t in when] if callable(time) else when.strftime(time)
    rows = [
        sep.join([stamp, *map(number, row)]) for stamp, *row in zip(stamps, *columns, strict=True)
    ]
    return "\n".join([header, *rows]) + "\n"


def read(tmp_path, text, name="table.csv", **declared):
    (tmp_path / name).write_text(text, encoding="utf-8")
    return radiation_table.read(tmp_path / name, **declared)


def comma(value):
    return str(value).replace(".", ",")


def span(t):
    return f"{t:%Y-%m-%d %H:%M},{t + pd.Timedelta('30min'):%Y-%m-%d %H:%M}"


def half_day(t):
    return f"{t:%m/%d/%Y} {t.hour % 12 or 12}:{t:%M}{'a' if t.hour < 12 else 'p'}"


IN_UTC = {"timezone": "UTC"}
READ = {
    "day and clock in a column called after days": (
        lines("Datum;Globalstrahlung [W/m²]", "%d.%m.%Y %H:%M", GLOBAL, sep=";", number=comma),
        IN_UTC,
    ),
    "twelve hours with dots": (
        lines("time,ghi", "%m/%d/%Y %I:%M %p", GLOBAL).replace("AM", "a.m.").replace("PM", "p.m."),
        IN_UTC,
    ),
    "twelve hours with one letter": (lines("time,ghi", half_day, GLOBAL), IN_UTC),
    "month, day, comma": (
        lines("time;ghi", "%b %d, %Y %H:%M", GLOBAL, sep=";"),
        IN_UTC,
    ),
    "clock with points": (lines("time,ghi", "%Y-%m-%d %H.%M", GLOBAL), IN_UTC),
    "start and end of each interval": (
        lines("from,to,ghi", span, GLOBAL),
        IN_UTC,
    ),
    "a logger's German export": (
        lines('"Nr.";"Datum Zeit, GMT+02:00";"Solarstrahlung, W/m² (LGR S/N: 1, SEN S/N: 2)"',
              lambda t: f"1;{t:%d.%m.%Y %H:%M:%S}", GLOBAL, sep=";", zone="+02:00", number=comma),
        {"timezone": "+02:00"},
    ),
    "two brackets behind a name": (
        lines('#,Date-Time (CEST),"Solar Radiation (W/m²) (S-LIB:1)"',
              lambda t: f"1,{t:%m/%d/%Y %H:%M:%S}", GLOBAL, zone="Europe/Berlin"),
        {},
    ),
    "watts in words": (
        lines("time,global [Watts per square meter]", "%Y-%m-%dT%H:%MZ", GLOBAL), {},
    ),
    "langleys a minute": (
        lines("time,global [ly/min]", "%Y-%m-%dT%H:%MZ", GLOBAL / 697.3333333), {},
    ),
    "sums of calories": (
        lines("time,global [cal/cm2]", "%Y-%m-%dT%H:%MZ", GLOBAL * 1800 / 4.184e4), {},
    ),
    "rows in JSON": (
        json.dumps([{"time": f"{t:%Y-%m-%dT%H:%MZ}", "ghi": g}
                    for t, g in zip(UTC, GLOBAL, strict=True)]), {},
    ),
    "columns in JSON": (
        json.dumps({"data": {"time": list(UTC.strftime("%Y-%m-%dT%H:%MZ")), "ghi": list(GLOBAL)}}),
        {},
    ),
    "PVGIS in JSON": (
        json.dumps({"inputs": {"mounting_system": {"fixed": {"slope": {"value": 0}}}},
                    "outputs": {"hourly": [
                        {"time": f"{t:%Y%m%d:%H%M}", "Gb(i)": g - d, "Gd(i)": d, "Gr(i)": 0.0}
                        for t, g, d in zip(UTC, GLOBAL, DIFFUSE, strict=True)]}}), {},
    ),
    "Open-Meteo in JSON": (
        json.dumps({"utc_offset_seconds": 7200, "hourly": {
            "time": list(UTC.tz_convert("+02:00").strftime("%Y-%m-%dT%H:%M")),
            "shortwave_radiation": list(GLOBAL), "diffuse_radiation": list(DIFFUSE)}}), {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("way", READ)
def test_radiation_is_read_whatever_way_it_is_written_in(tmp_path, way):
    text, declared = READ[way]
    table = read(tmp_path, text, **declared).table
    assert (table.index == UTC).all()
    np.testing.assert_allclose(table["global_w_m2"], GLOBAL, atol=0.1)


def test_hours_in_a_column_of_their_own_belong_to_the_day(tmp_path):
    hours = slice(None, None, 2)
    text = "date,hour,ghi\n" + "".join(
        f"{t:%Y-%m-%d},{t.hour},{g}\n" for t, g in zip(UTC[hours], GLOBAL[hours], strict=True)
    )
    assert (read(tmp_path, text, **IN_UTC).table.index == UTC[hours]).all()


def test_rows_with_start_and_end_are_means_stamped_with_the_start(tmp_path):
    found = read(tmp_path, lines("Beginn,Ende,ghi", span, GLOBAL), **IN_UTC)
    assert (found.label, found.interval_min) == ("start", 30.0)


@pytest.mark.parametrize(
    "flag", ["***", "#####", "-99.9", "-9999.9", "1e30", "-8888", ".", "1.#QNAN", "Invalid"]
)
def test_a_flag_of_a_logger_is_a_missing_value_and_counted(tmp_path, flag):
    with_flag = [flag if k == 10 else value for k, value in enumerate(GLOBAL)]
    found = read(tmp_path, lines("time,ghi", "%Y-%m-%dT%H:%MZ", with_flag))
    assert len(found.table) == len(UTC) - 1
    assert found.facts["missing"]["ghi"] == {flag: 1}


REFUSED = {
    "a span in a cell": (
        lines("time,ghi", lambda t: f"{t:%Y-%m-%d %H:%M}-{t + pd.Timedelta('30min'):%H:%M}",
              GLOBAL),
        "interval_label: start",
    ),
    "no zone": (lines("time,ghi", "%Y-%m-%d %H:%M", GLOBAL), "as `timezone` of this table"),
    "light for the eye": (lines("time,ghi [klx]", "%Y-%m-%dT%H:%MZ", GLOBAL), "18.5 µmol"),
    "broken JSON": ('{"outputs": {"hourly": [', "broken JSON"),
    "JSON without rows": ('{"outputs": {"hourly": 5}}', "no table in the JSON"),
    "a tilted plane": (
        json.dumps({"inputs": {"mounting_system": {"fixed": {"slope": {"value": 35}}}},
                    "outputs": {"hourly": [{"time": "20230820:1000", "G(i)": 5.0}]}}),
        "tilted by 35°",
    ),
}  # fmt: skip


@pytest.mark.parametrize("way", REFUSED)
def test_what_cannot_be_told_is_refused_with_what_to_do(tmp_path, way):
    text, remedy = REFUSED[way]
    with pytest.raises(InputError) as found:
        read(tmp_path, text)
    assert remedy in str(found.value)


def test_the_message_on_day_and_month_names_formats_that_work(tmp_path):
    when = pd.date_range("2023-08-10 06:00", periods=20, freq="10min", tz="UTC")
    text = "time,ghi\n" + "".join(f"{t:%m/%d/%y %I:%M:%S %p},5\n" for t in when)
    with pytest.raises(InputError) as found:
        read(tmp_path, text, **IN_UTC)
    assert "'%m/%d/%y %I:%M:%S %p'" in str(found.value)
    table = read(tmp_path, text, **IN_UTC, time_format="%m/%d/%y %I:%M:%S %p").table
    assert (table.index == when).all()


def test_a_skipped_hour_is_named_without_advice_to_programmers(tmp_path):
    text = "time,ghi\n2023-03-26 01:30,5\n2023-03-26 02:30,5\n"
    with pytest.raises(InputError, match=r"skips \(2023-03-26 02:30:00\).*'\+01:00'"):
        read(tmp_path, text, timezone="Europe/Berlin")


def records(tmp_path, text, name="par.csv", **declared):
    (tmp_path / name).write_text(text, encoding="utf-8")
    return measured.read(tmp_path / name, sensors=SENSORS, **declared)


@pytest.mark.parametrize(("written", "meant"), [("a1", "A1"), ("B2", "b2"), ("007", "7"),
                                               ("7.0", "7")])  # fmt: skip
def test_labels_that_differ_by_case_or_noughts_are_the_tables_and_it_is_said(
    tmp_path, written, meant
):
    found = records(tmp_path, f"sensor,time,PAR\n{written},2023-08-20T10:00Z,5\n")
    assert found.table["sensor"].tolist() == [meant]
    assert f"{written} as {meant}" in str(found.findings[0])


def test_labels_that_would_become_one_are_refused(tmp_path):
    text = "sensor,time,PAR\n07,2023-08-20T10:00Z,5\n007,2023-08-20T10:00Z,6\n"
    with pytest.raises(InputError, match="2 sensors without a position"):
        records(tmp_path, text)


def test_of_several_columns_of_light_none_is_taken_for_the_one_sensor_of_the_file(tmp_path):
    text = "time,PAR_Avg(1),PAR_Avg(2)\n2023-08-20T10:00Z,5,6\n"
    with pytest.raises(InputError, match="par_column"):
        records(tmp_path, text, name="A1.csv")
    one = records(tmp_path, text.replace("PAR_Avg(2)", "note"), name="A1.csv")
    assert one.table["sensor"].tolist() == ["A1"]


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("µEinstein/m2/s", 1), ("micromol/m2/s", 1), ("mol/m2/d", 0.0864), ("mmol m-2 s-1", 1e-3)],
)
def test_photons_are_read_in_their_units(tmp_path, unit, factor):
    found = records(tmp_path, f"sensor,time,PAR [{unit}]\nA1,2023-08-20T10:00Z,{500 * factor}\n")
    assert found.table["par_umol_m2_s"].tolist() == pytest.approx([500])
