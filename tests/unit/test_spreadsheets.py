"""Workbooks are read as the tables that they hold, or refused with what to do."""

import datetime
import zipfile

import openpyxl
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.formats import user_tables
from dapple.sky import radiation_table
from dapple.sky.radiation_table import read
from dapple.sky.sun import Site

FREIBURG = Site(48.0009, 7.8003, 230.0)
DAY = datetime.date(2023, 8, 10)


def workbook(path, *sheets):
    """A workbook of sheets, each a list of rows."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for number, rows in enumerate(sheets, start=1):
        sheet = book.create_sheet(f"Sheet {number}")
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_title_rows_a_day_and_a_clock_apart_and_empty_columns_do_not_matter(tmp_path):
    rows = [["Station 7"], [], ["Datum", "Uhrzeit", "Global [W/m²]", None, "Bemerkung"]]
    rows += [[DAY, datetime.time(12, 10 * k), 500 + k, None, None] for k in range(3)]
    rows += [[DAY, datetime.time(12, 30), 503.086, None, "cloud, thin"]]
    found = read(workbook(tmp_path / "a.xlsx", rows), timezone="UTC").table["global_w_m2"]
    assert found.index[-1] == pd.Timestamp("2023-08-10 12:30", tz="UTC")
    assert found.tolist() == [500.0, 501.0, 502.0, 503.086]


def test_times_that_a_fraction_of_a_day_cannot_hold_are_the_seconds_they_mean(tmp_path):
    times = pd.date_range("2023-08-10 10:00", periods=200, freq="7min", unit="ns")
    pd.DataFrame({"time_utc": times, "global": 500.0}).to_excel(tmp_path / "a.xlsx", index=False)
    assert (read(tmp_path / "a.xlsx").table.index == times.tz_localize("UTC")).all()


def test_the_end_of_a_day_as_24_hours_is_the_next_midnight(tmp_path):
    rows = [["date", "clock", "global"], [DAY, datetime.timedelta(hours=23, minutes=50), 1]]
    rows += [[DAY, datetime.timedelta(days=1), 2]]
    found = read(workbook(tmp_path / "a.xlsx", rows), timezone="UTC").table
    assert found.index[-1] == pd.Timestamp("2023-08-11 00:00", tz="UTC")


@pytest.mark.parametrize("decimal", ["", ","])
def test_numbers_in_cells_of_text_keep_their_comma(tmp_path, decimal):
    rows = [["time_utc", "global"], ["2023-08-10 12:00", "1,086"], ["2023-08-10 12:10", "853,25"]]
    rows += [["2023-08-10 12:20", 0.5]]
    path = workbook(tmp_path / "a.xlsx", rows)
    if decimal:
        assert read(path, decimal=decimal).table["global_w_m2"].tolist() == [1.086, 853.25, 0.5]
    else:
        with pytest.raises(InputError, match="decimal"):
            read(path)


def test_a_logger_s_own_layout_is_known_in_a_workbook_too(tmp_path):
    rows = [["TOA5", "a", "CR1000"], ["TIMESTAMP", "RECORD", "SlrW_Avg"], ["TS", "RN", "kW/m^2"]]
    rows += [["", "", "Avg"], [datetime.datetime(2023, 8, 10, 11), 1, 0.5]]
    rows += [[datetime.datetime(2023, 8, 10, 11, 10), 2, "NAN"]]
    found = read(workbook(tmp_path / "a.xlsx", rows), timezone="+01:00")
    assert found.facts["layout"] == "TOA5"
    assert found.table["global_w_m2"].tolist() == [500.0]


def test_errors_of_formulas_are_missing_values_that_are_counted(tmp_path):
    rows = [["time_utc", "global"], ["2023-08-10 12:00", "#N/A"], ["2023-08-10 12:10", 500]]
    rows += [["2023-08-10 12:20", "#DIV/0!"]]
    found = read(workbook(tmp_path / "a.xlsx", rows))
    assert found.facts["missing"] == {"global": {"#N/A": 1, "#DIV/0!": 1}}


TABLE = [["a", "b"], [1, 2]]


@pytest.mark.parametrize(
    ("sheets", "said"),
    [
        ([TABLE, TABLE], "tables on the sheets 'Sheet 1', 'Sheet 2'"),
        ([[["only a title"]]], "no table in the workbook"),
    ],
)
def test_a_workbook_has_one_table(tmp_path, sheets, said):
    with pytest.raises(InputError, match=said):
        user_tables.read(workbook(tmp_path / "a.xlsx", *sheets))


def test_a_sheet_of_remarks_beside_the_table_does_not_matter(tmp_path):
    found = user_tables.read(workbook(tmp_path / "a.xlsx", [["made by hand"]], TABLE))
    assert found.cells.to_numpy().tolist() == [["1", "2"]]


@pytest.mark.parametrize(
    ("member", "said"), [("mimetype", "workbook that is no XLSX"), ("a.csv", "Unpack it")]
)
def test_other_archives_are_refused_with_what_to_do(tmp_path, member, said):
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w") as archive:
        archive.writestr(member, "a")
    with pytest.raises(InputError, match=said):
        user_tables.read(tmp_path / "a.xlsx")


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_workbook_that_was_cut_off_is_refused(tmp_path, share):
    path = workbook(tmp_path / "a.xlsx", TABLE)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match="broken workbook"):
        user_tables.read(path)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\xd0\xcf\x11\xe0" + bytes(600), "Save it as XLSX or CSV"),
        (b'"TOB1","a","CR1000"\r\n"SECONDS"\r\n' + bytes(range(256)), "Card Convert"),
        (b'"TOB3","a","CR1000"\r\n', "Card Convert"),
    ],
)
def test_binary_formats_are_refused_with_the_program_that_converts_them(tmp_path, data, said):
    (tmp_path / "a.dat").write_bytes(data)
    with pytest.raises(InputError, match=said):
        radiation_table.read(tmp_path / "a.dat", site=FREIBURG)
