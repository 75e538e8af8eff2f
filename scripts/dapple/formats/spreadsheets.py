"""Workbooks of spreadsheet programs as lines of text, so that one reader reads all tables."""

import csv
import io
import re
import warnings
import zipfile
from datetime import date, datetime, time, timedelta
from pathlib import Path

from dapple.errors import InputError

OLD = b"\xd0\xcf\x11\xe0"
ZIPPED = b"PK\x03\x04"
AS_XLSX = "Save it as XLSX or CSV."
COMMA = re.compile(r"\s*[-+]?\d[\d.]*,\d+\s*$")
NEAR_SECOND = timedelta(milliseconds=2)
"""A spreadsheet keeps times as fractions of a day; what is so near to a second is one."""


def is_spreadsheet(path: Path) -> bool:
    """Whether a file begins as workbooks do."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(4) in (OLD, ZIPPED)


def lines(path: Path, decimal: str = "") -> tuple[list[str], str]:
    """The rows of a workbook's only table, with commas between the cells; row 1 comes first.

    Parameters
    ----------
    path : Path
    decimal : {"", ".", ","}
        Decimal sign of numbers that stand in cells of text, which those of others then get too.

    Returns
    -------
    lines : list of str
    decimal : str
        A point, or "" where numbers with a comma stand in cells of text.

    Raises
    ------
    InputError
        A workbook of another kind, a broken one, or tables on several sheets.
    """
    with path.open("rb") as file:
        if file.read(4) == OLD:
            raise InputError(path, "an old or a locked workbook", "a table", AS_XLSX)
    tables = {
        name: rows for name, rows in _sheets(path).items() if sum(len(row) > 1 for row in rows) > 1
    }
    if not tables:
        raise InputError(path, "no table in the workbook", "a sheet with a table", AS_XLSX)
    if len(tables) > 1:
        raise InputError(
            path,
            f"tables on the sheets {', '.join(map(repr, tables))}",
            "one table",
            "Keep the sheet that is meant, or save it as CSV.",
        )
    (rows,) = tables.values()
    width = max(map(len, rows))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in rows:
        cells = [_text(value, number_format, decimal) for value, number_format in row]
        writer.writerow(cells + [""] * (width - len(cells)) if any(cells) else [])
    is_text = any(COMMA.match(v) for row in rows for v, _ in row if isinstance(v, str))
    return text.getvalue().split("\n")[:-1], "" if is_text else "."


def _sheets(path: Path) -> dict[str, list[list[tuple[object, str]]]]:
    """Value and number format of the cells, by sheet that is shown."""
    import openpyxl  # takes a quarter of a second, and few tables are workbooks

    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
        if "xl/workbook.xml" not in names:
            kind = "a workbook" if {"mimetype", "xl/workbook.bin"} & names else "a ZIP archive"
            remedy = AS_XLSX if kind == "a workbook" else "Unpack it and name the table inside."
            raise InputError(path, f"{kind} that is no XLSX", "a table", remedy)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on styles and menus that hold no data
            book = openpyxl.load_workbook(path, data_only=True)
    except (zipfile.BadZipFile, KeyError, ValueError, OSError, EOFError, SyntaxError) as error:
        raise InputError(path, f"a broken workbook ({error})", "a table", AS_XLSX) from error
    return {
        sheet.title: [
            _filled([(cell.value, cell.number_format) for cell in row])
            for row in sheet.iter_rows(min_row=1, min_col=1)
        ]
        for sheet in book.worksheets
        if sheet.sheet_state == "visible"
    }


def _filled(row: list[tuple[object, str]]) -> list[tuple[object, str]]:
    """A row without the empty cells at its end."""
    while row and row[-1][0] in (None, ""):
        row.pop()
    return row


def _text(value: object, number_format: str, decimal: str) -> str:
    """A cell as it would stand in a text table."""
    if value is None:
        return ""
    if isinstance(value, datetime):
        if "h" not in number_format.lower():
            return f"{value:%Y-%m-%d}"
        return _whole_seconds(value).isoformat(sep=" ")
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, time):
        moment = _whole_seconds(datetime.combine(date(2000, 1, 1), value))
        return "24:00:00" if moment.day > 1 else moment.time().isoformat()
    if isinstance(value, timedelta):
        seconds = round(value.total_seconds())
        return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    if isinstance(value, float):
        return f"{value:.15g}".replace(".", decimal or ".")
    return " ".join(str(value).split())


def _whole_seconds(moment: datetime) -> datetime:
    """The second that a moment is next to, if it is very near."""
    second = (moment + timedelta(seconds=0.5)).replace(microsecond=0)
    return second if abs(second - moment) <= NEAR_SECOND else moment
