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
EXCEL = pd.Timestamp("1899-12-30", tz="UTC")
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
    "hours with a fraction": (
        lines("date,hour,ghi", lambda t: f"{t:%Y-%m-%d},{t.hour + t.minute / 60:.4f}", GLOBAL),
        IN_UTC,
    ),
    "day of the year and hours with a fraction": (
        lines("year,doy,hour,ghi",
              lambda t: f"{t.year},{t.day_of_year},{t.hour + t.minute / 60:.2f}", GLOBAL), IN_UTC,
    ),
    "day of the year with a fraction": (
        lines("year;doy;ghi",
              lambda t: comma(f"{t.year};{t.day_of_year + (t.hour + t.minute / 60) / 24:.5f}"),
              GLOBAL, sep=";", number=comma), IN_UTC,
    ),
    "year, month, day and clock": (
        lines("Station,Year,Month,Day,Time [UTC],Global radiation mean [W/m2]",
              lambda t: f"Kumpula,{t.year},{t.month},{t.day},{t:%H:%M}", GLOBAL), {},
    ),
    "days of a spreadsheet with commas": (
        lines("time;ghi", lambda t: comma(f"{(t - EXCEL) / pd.Timedelta('1D'):.6f}"), GLOBAL,
              sep=";", number=comma), IN_UTC | {"time_format": "excel"},
    ),
    "a German month and Uhr": (
        lines("Zeit;ghi", lambda t: f"{t:%d}. August {t:%Y, %H:%M} Uhr", GLOBAL, sep=";",
              number=comma), IN_UTC,
    ),
    "a French month": (
        lines("Date;ghi", lambda t: f"{t:%d} août {t:%Y %H:%M}", GLOBAL, sep=";", number=comma),
        IN_UTC,
    ),
    "as mails are stamped": (
        lines("time,ghi", lambda t: t.strftime('"%a, %d %b %Y %H:%M:%S GMT"'), GLOBAL), {},
    ),
    "months before days, with points": (
        lines("time;ghi", "%m.%d.%Y %H:%M", GLOBAL, sep=";"), IN_UTC,
    ),
    "a zone behind the name": (
        lines("Time_MESZ,ghi", "%Y-%m-%d %H:%M", GLOBAL, zone="+02:00"), {},
    ),
    "a logger's export for the web": (
        lines('"Line#","Date","Solar Radiation (S-LIB 2:2-1),W/m^2,Plot","Temp, *C"',
              lambda t: f"1,{t:%m/%d/%y %H:%M:%S}", GLOBAL, GLOBAL), IN_UTC,
    ),
    "METER": (
        lines("z6-1,Port 1,Port 1\n3 records,ATMOS 41,ATMOS 41\n"
              "Timestamps,W/m² Solar Radiation,mm Rain", "%Y-%m-%d %H:%M:%S", GLOBAL, GLOBAL),
        IN_UTC,
    ),
    "Davis": (
        lines("\t\tTemp\tSolar\tHi Solar\nDate\tTime\tOut\tRad.\tRad.",
              lambda t: f"{t:%m/%d/%y}\t{half_day(t)[11:]}\t20", GLOBAL, GLOBAL + 9, sep="\t"),
        IN_UTC | {"time_format": "%m/%d/%y %I:%M%p"},
    ),
    "a title over a table of WeatherLink": (
        lines('"Plot"\n"Davis"\n\n"Date & Time","Bar - mb","Solar Rad - W/m^2"',
              lambda t: f'"{t:%m/%d/%y %H:%M}","1,013.2"', GLOBAL), IN_UTC,
    ),
    "a break in the name of a column": (
        lines('time,"ghi\n(W/m²)"', "%Y-%m-%dT%H:%MZ", GLOBAL), {},
    ),
    "semicolons within quotes": (
        lines("time,ghi,note", "%Y-%m-%dT%H:%MZ", GLOBAL, ['"a; b; c; d"'] * len(UTC)), {},
    ),
    "files behind one another": (
        lines("time,ghi", "%Y-%m-%dT%H:%MZ", GLOBAL).replace(
            "2023-08-20T09:00Z", "time,ghi\n2023-08-20T09:00Z"), {},
    ),
    "remarks in brackets": (
        lines("time,Global Irradians (svenska stationer)", "%Y-%m-%dT%H:%MZ", GLOBAL), {},
    ),
    "an hour in brackets": (
        lines("Tid(norsk normaltid);Globalstråling (1 t)", "%d.%m.%Y %H:%M", GLOBAL, sep=";",
              number=comma), IN_UTC,
    ),
    "megajoules in an hour": (
        lines("time,global [MJ/m²/h]", "%Y-%m-%dT%H:%MZ", GLOBAL * 0.0036), {},
    ),
    "watts per Quadratmeter": (lines("time,global [W/qm]", "%Y-%m-%dT%H:%MZ", GLOBAL), {}),
    "joules a second": (lines("time,global [J m-2 s-1]", "%Y-%m-%dT%H:%MZ", GLOBAL), {}),
    "direct and diffuse": (
        lines("time,bhi,dhi", "%Y-%m-%dT%H:%MZ", GLOBAL - DIFFUSE, DIFFUSE), {},
    ),
    "illuminance that is declared": (
        lines("time,global [klx]", "%Y-%m-%dT%H:%MZ", GLOBAL * 0.11), {"unit": "klx"},
    ),
    "an object a line": (
        "\n".join(json.dumps({"time": f"{t:%Y-%m-%dT%H:%MZ}", "ghi": g})
                  for t, g in zip(UTC, GLOBAL, strict=True)), {},
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
    "flag",
    [
        "***",
        "#####",
        "-99.9",
        "-9999.9",
        "1e30",
        "-8888",
        ".",
        "1.#QNAN",
        "Invalid",
        "9999.9",
        "-999999",
        "32767",
        "65535",
    ],
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
    "thousands or decimals": (
        lines("time;ghi", "%Y-%m-%dT%H:%MZ", np.round(3 * GLOBAL), sep=";",
              number=lambda value: f"{value:,.0f}".replace(",", ".")),
        "Set `decimal`",
    ),
    "sums since midnight": (
        lines("valid_time,ssrd,latitude", "%Y-%m-%d %H:%M:%S", np.cumsum(GLOBAL) * 3600, GLOBAL),
        "differences between hours",
    ),
    "direct radiation on some plane": (
        lines("time,direct,diffuse", "%Y-%m-%dT%H:%MZ", GLOBAL, DIFFUSE), "direct_plane: normal"),
    "light for the eye": (
        lines("time,ghi [klx]", "%Y-%m-%dT%H:%MZ", GLOBAL), "radiation.unit: klx"),
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


def test_the_hours_of_nasa_power_are_those_of_fifteen_degrees_of_longitude(tmp_path):
    hours = slice(None, None, 2)
    head = ("-BEGIN HEADER-\nNASA/POWER CERES/MERRA2 Native Resolution Hourly Data \n"
            "Dates (month/day/year): 08/20/2023 through 08/20/2023 in LST\n"
            "Location: Latitude  48.0   Longitude 20.1 \nParameter(s): \n"
            "ALLSKY_SFC_SW_DWN      CERES SYN1deg All Sky Irradiance (MJ/hr) \n-END HEADER-\n"
            "YEAR,MO,DY,HR,ALLSKY_SFC_SW_DWN\n")  # fmt: skip
    rows = "".join(
        f"{t:%Y},{t.month},{t.day},{t.hour},{0.0036 * g}\n"
        for t, g in zip(UTC[hours].tz_convert("+01:00"), GLOBAL[hours], strict=True)
    )
    found = read(tmp_path, head + rows).table
    assert (found.index == UTC[hours]).all()
    np.testing.assert_allclose(found["global_w_m2"], GLOBAL[hours], atol=0.1)


def test_hours_of_era5_are_sums_before_their_stamp_and_its_beam_is_level(tmp_path):
    hours = slice(None, None, 2)
    text = "valid_time,ssrd,fdir\n" + "".join(
        f"{t:%Y-%m-%d %H:%M:%S},{3600 * g},{3600 * (g - d)}\n"
        for t, g, d in zip(UTC[hours], GLOBAL[hours], DIFFUSE[hours], strict=True)
    )
    found = read(tmp_path, text)
    assert (found.label, found.interval_min) == ("end", 60.0)
    np.testing.assert_allclose(found.table["global_w_m2"], GLOBAL[hours], atol=0.1)
    np.testing.assert_allclose(found.table["diffuse_w_m2"], DIFFUSE[hours], atol=0.1)


@pytest.mark.parametrize("zone", ["UTC 1", "2", "GMT1"])
def test_an_offset_without_its_sign_is_not_guessed(tmp_path, zone):
    text = lines("time,ghi", "%Y-%m-%d %H:%M", GLOBAL)
    with pytest.raises(InputError, match="ahead of Greenwich"):
        read(tmp_path, text, timezone=zone)


def test_records_in_lux_are_daylight_only_where_somebody_says_so(tmp_path):
    text = "sensor,time,PAR [lux]\nA1,2023-08-20T10:00Z,54000\n"
    with pytest.raises(InputError, match=r"`measured.unit: lx`.*18\.5 µmol"):
        records(tmp_path, text)
    found = records(tmp_path, text, unit="lx")
    assert found.table["par_umol_m2_s"].tolist() == pytest.approx([1000])
    assert "twice as bright" in " ".join(map(str, found.findings))
