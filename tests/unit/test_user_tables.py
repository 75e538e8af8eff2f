"""Tables in the layouts that loggers, services and spreadsheets write."""

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.formats import column_names, time_columns, units, user_tables
from dapple.formats.user_tables import LIGHT_FLAGS
from dapple.times import parse


def written(tmp_path, text, name="table.csv", encoding="utf-8"):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding))
    return path


# --- text ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_any_common_encoding_and_line_end_is_read(tmp_path, encoding, end):
    text = end.join(["Wärme °C;Wert", "20,1;0,5", "20,2;0,6", ""])
    table = user_tables.read(written(tmp_path, text, encoding=encoding))
    assert list(table.cells) == ["Wärme °C", "Wert"]
    assert table.numbers("Wert").values.tolist() == [0.5, 0.6]


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", "   "])
def test_any_delimiter_is_found(tmp_path, delimiter):
    rows = [["label", "X", "Y"], ["a", "1.5", "-2"], ["b", "3", "4e1"]]
    table = user_tables.read(written(tmp_path, "\n".join(map(delimiter.join, rows))))
    assert table.numbers("Y").values.tolist() == [-2.0, 40.0]
    assert table.text("label").tolist() == ["a", "b"]


def test_titles_comments_blank_lines_and_a_row_of_units_are_no_data(tmp_path):
    text = (
        "My station\n# made by hand\n\ntime,light\nUTC,umol m-2 s-1\n2023-08-10,5\n\n2023-08-11,6\n"
    )
    table = user_tables.read(written(tmp_path, text))
    light = table.numbers("light")
    assert light.values.tolist() == [5.0, 6.0]
    assert light.unit == "umol m-2 s-1"
    assert table.cells.index.tolist() == [6, 8]  # lines of the file, for messages


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "an empty file"),
        ("PK\x03\x04", "a broken workbook"),
        ("1,2\n3,4\n", "no header"),
        ("a,b\n1,2\n3\n4,5\n", "line 3: found 1 cells"),
        ("a,b\n1,2,3\n1,2,3\n", "found 3 cells"),
    ],
)
def test_what_is_no_table_is_refused_with_its_line(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        user_tables.read(written(tmp_path, text))
    with pytest.raises(InputError, match="no file"):
        user_tables.read(tmp_path / "none.csv")


def test_a_name_that_is_there_twice_stops_only_who_asks_for_it(tmp_path):
    table = user_tables.read(written(tmp_path, "time,light,temp,temp\n2023-08-10,5,20,21\n"))
    assert table.numbers("light").values.tolist() == [5.0]
    with pytest.raises(InputError, match="two columns called temp"):
        table.numbers("temp")


def test_a_header_may_stand_in_the_last_comment_and_empty_rows_are_passed_over(tmp_path):
    text = "# STATION X\n# a;b\n1;2\n;\n3;4\n"
    table = user_tables.read(written(tmp_path, text))
    assert table.numbers("b").values.tolist() == [2.0, 4.0]


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_is_known_without_its_mark(tmp_path, encoding):
    table = user_tables.read(written(tmp_path, "time;light\n" + 9 * "x;5,5\n", encoding=encoding))
    assert table.numbers("light").values.tolist() == 9 * [5.5]


# --- names of columns -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    ["GHI", "ghi_wm2", "Global [W/m²]", "SlrW_Avg", "Globalstrahlung", "Radiación global",
     "Rayonnement global (W/m2)", "Solar Rad. - W/m^2", "SW_IN", "Global Horizontal [W/m^2]"],
)  # fmt: skip
def test_global_radiation_is_found_by_what_people_call_it(name):
    assert column_names.first(column_names.GLOBAL, ["T", "Wind (m/s)", name]) == name


@pytest.mark.parametrize(
    ("header", "row", "zone"),
    [
        ("Zeit (MEZ),light", "10.08.2023 10:30,5", "MEZ"),
        ("datetime_utc,light", "2023-08-10 10:30,5", "utc"),
        ("Date,Time,light", "2023-08-10,10:30,5", None),
        ("Datum,Uhrzeit,light", "10.08.2023,10:30:00,5", None),
        ("Fecha,Hora,light", "2023/08/10,10:30,5", None),
        ("DATE,MST,light", "2023-08-10,10:30,5", "MST"),
        ("Date,Time,light", "20230810,1030,5", None),
        ("Year,Month,Day,Hour,Minute,light", "2023,8,10,10,30,5", None),
        ("YEAR,DOY,HHMM,light", "2023,222,1030,5", None),
        ("year,jday,hour,light,minute", "2023,222,10,5,30", None),
    ],
)
def test_times_may_stand_in_several_columns(tmp_path, header, row, zone):
    table = user_tables.read(written(tmp_path, f"{header}\n{row}\n"))
    times = time_columns.of(table, "", "time_column")
    assert parse(times.text, "here", "UTC")[0] == pd.Timestamp("2023-08-10 10:30", tz="UTC")
    assert times.zone == zone


def test_columns_of_a_time_may_be_named_and_a_part_that_is_no_number_is_refused(tmp_path):
    table = user_tables.read(written(tmp_path, "d,c,light\n2023-08-10,1030,5\n"))
    times = time_columns.of(table, "d + c", "time_column")
    assert times.text.tolist() == ["2023-08-10 10:30"]
    table = user_tables.read(written(tmp_path, "year,doy,hhmm,light\n2023,x,1030,5\n"))
    with pytest.raises(InputError, match="column 'doy', line 2: found 'x'"):
        time_columns.of(table, "", "time_column")


# --- numbers --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["1.5", "2"], [1.5, 2]),
        (["1,5", "2"], [1.5, 2]),
        (["1,234.5", "2"], [1234.5, 2]),
        (["1.234,5", "2"], [1234.5, 2]),
        (["998", "1,002", "1,100"], [998, 1002, 1100]),
        (["1 234", "12 345,6"], [1234, 12345.6]),
        (["1'234.5", "−2"], [1234.5, -2]),
        (["1e-3", "1.5E+2"], [0.001, 150]),
        (["1.234.567", "0,5"], [1234567, 0.5]),
        (["350 nm", "351 nm"], [350, 351]),
        (["12 %", "13 %"], [12, 13]),
        (["0,123", "0,456"], [0.123, 0.456]),
    ],
)
def test_numbers_are_read_as_people_write_them(tmp_path, cells, values):
    table = user_tables.read(written(tmp_path, "a;b\n" + "".join(f"x;{c}\n" for c in cells)))
    assert table.numbers("b").values.tolist() == pytest.approx(values)


def test_a_comma_that_may_be_either_sign_is_refused_unless_another_column_or_a_key_tells(tmp_path):
    path = written(tmp_path, "a;b\nx;1,234\ny;2,345\n")
    with pytest.raises(InputError, match=r"1,234, which may be 1.234 or 1234.*`decimal`"):
        user_tables.read(path).numbers("b")
    assert user_tables.read(path, decimal=",").numbers("b").values.tolist() == [1.234, 2.345]
    assert user_tables.read(path, decimal=".").numbers("b").values.tolist() == [1234, 2345]
    told = user_tables.read(written(tmp_path, "a;b\n0,5;1,234\n0,5;2,345\n"))
    assert told.numbers("b").values.tolist() == [1.234, 2.345]


@pytest.mark.parametrize("flag", ["", "NAN", "nan", "NA", "-999", "-9999.0", "9999", "--", "INF"])
def test_flags_of_missing_values_are_counted(tmp_path, flag):
    table = user_tables.read(written(tmp_path, f"a,b\nx,{flag}\ny,7\n"))
    numbers = table.numbers("b", LIGHT_FLAGS)
    assert np.isnan(numbers.values[0])
    assert numbers.values[1] == 7
    assert numbers.missing == {flag: 1}


def test_text_that_is_neither_number_nor_flag_is_refused_with_its_line(tmp_path):
    table = user_tables.read(written(tmp_path, "a,b\nx,7\ny,broken\n"))
    with pytest.raises(InputError, match=r"column 'b', line 3: found 'broken'"):
        table.numbers("b")
    assert np.isnan(table.numbers("b", ["broken"]).values[1])
    mixed = user_tables.read(written(tmp_path, "a,b\nx,7 nm\ny,8 um\n"))
    with pytest.raises(InputError, match="different units"):
        mixed.numbers("b")


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("W m⁻²", "W/m2"),
        ("W/m^2", "W/m2"),
        ("global_W_m2", "W/m2"),
        ("J cm-2", "J/cm2"),
        ("MJ/m²", "MJ/m2"),
        ("kWh/m**2", "kWh/m2"),
        ("µmol m-2 s-1", "umol/m2/s"),
        ("par_umolm2s", "umol/m2/s"),
        ("uE", "umol/m2/s"),
        ("lux", "lx"),
        ("Glob_Avg", None),
    ],
)
def test_units_are_known_however_they_are_spelled(text, unit):
    assert units.named(text) == unit


def test_a_sum_over_ten_minutes_is_a_flux():
    assert 48.0 * units.irradiance_factor("J/cm2", 10, "f") == pytest.approx(800.0)
    assert 0.8 * units.irradiance_factor("kWh/m2", 60, "f") == pytest.approx(800.0)
    assert 1.8 * units.photon_factor("mol/m2", 60, "f") == pytest.approx(500.0)


# --- layouts by name ------------------------------------------------------------------------------


def facts(table):
    return table.layout, table.timezone, table.interval_label, table.interval_min


def test_campbell_toa5(tmp_path):
    text = (
        '"TOA5","CR1000","CR1000","12345","Std.32","CPU:par.CR1","4711","Tab10"\n'
        '"TIMESTAMP","RECORD","Glob_Avg"\n"TS","RN","W/m^2"\n"","","Avg"\n'
        '"2023-08-10 00:10:00",0,"NAN"\n"2023-08-10 00:20:00",1,12.5\n'
    )
    table = user_tables.read(written(tmp_path, text, "par.dat"))
    assert table.layout == "TOA5"
    assert table.known["time"] == "TIMESTAMP"
    assert table.numbers("Glob_Avg").unit == "W/m^2"
    assert table.numbers("Glob_Avg").missing == {"NAN": 1}


@pytest.mark.parametrize(
    ("head", "zone"),
    [
        ('"#","Date Time, GMT+01:00","PAR, uE (LGR S/N: 1, SEN S/N: 2, LBL: W3)"', "+01:00"),
        ('"#","Date Time, GMT-06:00","PAR, µmol/m²/s (LGR S/N: 1)"', "-06:00"),
        ('"#","Date-Time (UTC)","PAR (µmol/m²/s)"', "UTC"),
    ],
)
def test_onset_hobo(tmp_path, head, zone):
    path = written(tmp_path, f'"Plot Title: p"\n{head}\n1,08/13/23 01:10:00 PM,512.5\n')
    table = user_tables.read(path)
    assert facts(table)[:2] == ("HOBO", zone)
    numbers = table.numbers(table.cells.columns[-1])
    assert numbers.values.tolist() == [512.5]
    assert units.named(numbers.unit) == "umol/m2/s"


def test_dwd_hourly_sums(tmp_path):
    text = (
        "STATIONS_ID;MESS_DATUM;QN_592;ATMO_LBERG;FD_LBERG;FG_LBERG;SD_LBERG;ZENIT;"
        "MESS_DATUM_WOZ;eor\n"
        "       1443;2023081011:23;    1;   118;  33.0; 288.0;   60;  38.1;2023081012:00;eor\n"
    )
    table = user_tables.read(written(tmp_path, text, "produkt_st_stunde.txt"))
    assert facts(table) == ("DWD", "UTC", "end", 60.0)
    assert table.known == {"time": "MESS_DATUM", "global": "FG_LBERG", "diffuse": "FD_LBERG"}
    assert table.numbers("FG_LBERG").unit == "J/cm2"


def test_bsrn_as_pangaea_has_it(tmp_path):
    text = (
        "/* DATA DESCRIPTION:\nCitation:\tSomebody (2023)\n*/\n"
        "Date/Time\tHeight above ground [m]\tSWD [W/m**2]\tDIF [W/m**2]\tDIR [W/m**2]\n"
        "2023-08-10T11:00\t2\t801\t95\t830\n2023-08-10T11:01\t2\t\t95\t830\n"
    )
    table = user_tables.read(written(tmp_path, text, "station.tab"))
    assert facts(table) == ("PANGAEA", "UTC", "start", 1.0)
    assert table.known["global"] == "SWD [W/m**2]"
    assert table.numbers("SWD [W/m**2]").missing == {"": 1}


def test_nsrdb_has_its_zone_in_the_second_line(tmp_path):
    text = (
        "Source,Location ID,City,Latitude,Longitude,Time Zone,Elevation,Local Time Zone\n"
        "NSRDB,1,-,40.0,-105.2,-7,1600,-7\n"
        "Year,Month,Day,Hour,Minute,GHI,DHI,DNI\n2023,8,10,9,30,701,88,800\n"
    )
    table = user_tables.read(written(tmp_path, text))
    assert facts(table) == ("NSRDB", "-07:00", "", 0.0)
    assert table.text("time").tolist() == ["2023-08-10 09:30"]
    assert table.known["global"] == "GHI"


def test_pvgis_hourly_adds_beam_and_diffuse_and_wants_a_level_plane(tmp_path):
    text = (
        "Latitude (decimal degrees):\t48.000\nLongitude (decimal degrees):\t7.800\n"
        "Elevation (m):\t230\nRadiation database:\tPVGIS-SARAH3\n\nSlope: {slope} deg.\n"
        "Azimuth: 0 deg.\ntime,Gb(i),Gd(i),Gr(i),H_sun,T2m,WS10m,Int\n"
        "20230810:1110,700.5,99.5,0.0,57,24,2,0.0\n\nGb(i): Direct irradiance\n"
    )
    table = user_tables.read(written(tmp_path, text.format(slope=0)))
    assert facts(table) == ("PVGIS", "UTC", "", 0.0)
    assert table.numbers(table.known["global"]).values.tolist() == [800.0]
    with pytest.raises(InputError, match="tilted by 35"):
        user_tables.read(written(tmp_path, text.format(slope=35)))


def test_fluxnet_stamps_mark_the_start(tmp_path):
    text = (
        "TIMESTAMP_START,TIMESTAMP_END,SW_IN,PPFD_IN\n"
        "202308101100,202308101130,800.0,1650.0\n202308101130,202308101200,-9999,-9999\n"
    )
    table = user_tables.read(written(tmp_path, text))
    assert facts(table) == ("FLUXNET", None, "start", 30.0)
    assert table.known["par"] == "PPFD_IN"
    assert table.numbers("SW_IN", LIGHT_FLAGS).missing == {"-9999": 1}


def test_cams_names_the_period_of_every_row(tmp_path):
    row = "2023-08-10T10:{}:00.0/2023-08-10T10:{}:00.0;300;{};100\n"
    text = "# Coding: utf-8\n# Observation period;TOA;GHI;DHI\n"
    text += row.format("00", "15", 200) + row.format("15", "30", 210)
    table = user_tables.read(written(tmp_path, text))
    assert (table.layout, table.timezone) == ("CAMS", "UTC")
    assert (table.interval_label, table.interval_min) == ("start", 15.0)
    assert table.units["GHI"] == "Wh/m2"
    assert table.text(table.known["time"]).iloc[0] == "2023-08-10T10:00:00.0"


def test_solcast_stamps_the_end_of_its_period(tmp_path):
    text = "Ghi,Dhi,PeriodEnd,PeriodStart,Period\n500,100,2023-08-10T10:30:00Z,x,PT30M\n"
    table = user_tables.read(written(tmp_path, text))
    assert (table.layout, table.interval_label, table.interval_min) == ("Solcast", "end", 30.0)
    assert table.known == {"time": "PeriodEnd", "global": "Ghi", "diffuse": "Dhi"}


def test_open_meteo_has_its_offset_in_the_second_line(tmp_path):
    text = (
        "latitude,longitude,elevation,utc_offset_seconds,timezone,timezone_abbreviation\n"
        "48,7.8,230,7200,Europe/Berlin,CEST\n\n"
        "time,shortwave_radiation (W/m²),diffuse_radiation (W/m²)\n2023-08-10T10:00,500,100\n"
    )
    table = user_tables.read(written(tmp_path, text))
    assert (table.layout, table.timezone, table.interval_label) == ("Open-Meteo", "+02:00", "end")
    assert table.numbers(table.known["global"]).values.tolist() == [500.0]
