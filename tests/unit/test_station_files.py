"""Files of loggers and weather services that are cut, or hold less than others of their kind: each
is read as what it is, or refused with what to do."""

import pytest

from dapple.errors import InputError
from dapple.formats import user_tables


def written(tmp_path, text):
    path = tmp_path / "station.txt"
    path.write_text(text)
    return path


def archive(rows):
    """A month of BSRN's station-to-archive file: two lines a minute in columns of fixed width."""
    lines = ["*U0001", " 21  8 2023  1", "*U0004", " -1 -1 -1", " 11  1", "Some Street 1"]
    lines += [f"{'+1':20}+2", f"{'1.2.3.4':15}a@b.c", f"{138.0:8.3f}{187.8:8.3f}{230:5d} 12345"]
    lines += [" -1 -1 -1", "  0  2 90  3", "*U0100"]
    for day, minute, total, diffuse in rows:
        lines.append(f"{day:3d} {minute:5d} {total:6d}{1.0:6.1f}{total:5d}{total:5d}{-999:7d}")
        lines.append(f"{'':10}{diffuse:6d}{1.0:6.1f}{diffuse:5d}{diffuse:5d}")
    return "\n".join([*lines, "*U0300", ""])


def test_the_archive_file_of_bsrn_has_minutes_stamped_with_their_start(tmp_path):
    table = user_tables.read(written(tmp_path, archive([(10, 660, 801, 95), (10, 661, -999, 95)])))
    assert (table.layout, table.timezone, table.interval_label) == ("BSRN", "UTC", "start")
    assert table.interval_min == 1.0
    assert table.text("time").tolist() == ["2023-08-10 11:00", "2023-08-10 11:01"]
    found = table.numbers("ghi")
    assert found.values[0] == 801.0
    assert found.values[1:] != pytest.approx(-999.0)  # missing, no radiation below nothing
    assert table.numbers("dhi").values.tolist() == [95.0, 95.0]


def test_a_logger_s_table_without_units_and_a_table_without_radiation_are_read(tmp_path):
    logger = (
        "TOACI1,CR1000,Table1\nTMSTAMP,RECNBR,PAR\n2023-08-10 11:00,1,5\n2023-08-10 11:01,2,6\n"
    )
    table = user_tables.read(written(tmp_path, logger))
    assert (table.layout, table.numbers("PAR").values.tolist()) == ("TOACI1", [5.0, 6.0])
    service = "STATIONS_ID;MESS_DATUM;QN;TT_10;eor\n1443;202308101100;3;21.4;eor\n"
    assert user_tables.read(written(tmp_path, service)).known == {"time": "MESS_DATUM"}
    pangaea = "/* DATA */\nDate/Time\tT2 [°C]\n2023-08-10T11:00\t21.4\n"
    table = user_tables.read(written(tmp_path, pangaea))
    assert (table.timezone, table.known) == ("UTC", {"time": "Date/Time"})


REFUSED = {
    "an archive file that ends in its head": (
        "*U0001\n 21  8 2023  1\n",
        "Copy the file again, or",
    ),
    "a comment that never ends": ("/* DATA DESCRIPTION:\nDate/Time\tSWD\n", "Copy the file again"),
    "a comment and no more": ("/* DATA DESCRIPTION:\nno rows\n*/\n", "a table below it"),
    "NSRDB without minutes": (
        "Source,Location ID,Time Zone\nNSRDB,1,-7\nYear,Month,Day,Hour,GHI\n2023,8,10,9,701\n",
        "no column Minute",
    ),
    "NSRDB with a zone beyond all": (
        "Source,Location ID,Time Zone\nNSRDB,1,-700\nYear,Month,Day,Hour,Minute\n2023,8,10,9,30\n",
        "hours east of Greenwich",
    ),
    "PVGIS without a table": (
        "Latitude (decimal degrees):\t48.0\nElevation (m):\t230\nmonth,day\n",
        "no line that begins with `time`",
    ),
    "PVGIS without radiation": (
        "Latitude (decimal degrees):\t48.0\nElevation (m):\t230\ntime,T2m\n20230810:1110,24\n",
        "G(h), G(i), or Gb(i) and Gd(i)",
    ),
    "CAMS without the end of a period": (
        "# Observation period;TOA;GHI\n2023-08-10T10:00:00.0;300;200\n",
        "rows without a period",
    ),
    "KNMI with an hour beyond the day": (
        "# STN,YYYYMMDD,HH,Q\n260,20230810,25,180\n",
        "day '20230810' and hour '25'",
    ),
    "SURFRAD cut after its clock": (
        " Boulder\n  40.125 -105.237 1689 m version 1\n 2023 222 8 10 0 0 0.0\n",
        "a day of 48 columns",
    ),
    "MIDC without a day": (
        "Year,DOY,MST,Global Horizontal [W/m^2]\n2023,none,0900,701\n",
        "a row without a day",
    ),
    "EPW cut within its rows": (
        "LOCATION,Freiburg,-,DEU,TMY,1,48.0,7.8,1.0,230\n" + "X\n" * 7 + "2023,8,10,10,60,C9\n",
        "35, as EPW has",
    ),
    "CAMS without rows": ("# Observation period;TOA;GHI;DHI\n", "rows without a period"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_of_a_service_that_is_not_whole_is_refused_with_what_to_do(tmp_path, case):
    text, said = REFUSED[case]
    with pytest.raises(InputError) as found:
        user_tables.read(written(tmp_path, text))
    assert said in str(found.value)


def test_a_day_of_the_year_is_a_day(tmp_path):
    text = "Year,DOY,MST,Global Horizontal [W/m^2]\n2023,222,900,701\n2023,222,0901,702\n"
    table = user_tables.read(written(tmp_path, text))
    assert table.layout == "MIDC"
    assert table.text("time").tolist() == ["2023-08-10 09:00", "2023-08-10 09:01"]
