"""Where a table has its times: one column, a day and a clock, or a number for each part."""

import re
from dataclasses import dataclass

import pandas as pd

from dapple import timezones
from dapple.errors import InputError
from dapple.formats import column_names, table_numbers
from dapple.formats.text_table import Table

TOGETHER = " + "
"""Between the names of columns that make a time together, in configurations and messages."""


DAY_WITH_CLOCK = r".*\d[T ]+\d{1,2}[:.h]\d\d.*|\d{10}|\d{12}|\d{14}"
"""Of cells in a column that is called after days: they tell the time of the day too."""


@dataclass(frozen=True)
class Times:
    """Times of a table, as text.

    Attributes
    ----------
    text : pandas.Series
        Named after its columns; the index is the line of the file.
    zone : str or None
        As the name of a column has it.
    """

    text: pd.Series
    zone: str | None


def of(table: Table, declared: str, key: str) -> Times:
    """The times of a table.

    Parameters
    ----------
    table : Table
    declared : str
        Name of the column, or several with " + " between them; empty: found by usual names.
    key : str
        Of the configuration, for messages.

    Raises
    ------
    InputError
        No such column, or a part of a time that is no number.
    """
    if declared:
        found = [table.require([name], key) for name in declared.split(TOGETHER)]
        return _joined(table, found)
    if column := table.known.get("time"):
        return _joined(table, [column])
    if apart := _day_and_clock(table):
        return _joined(table, apart)
    if column := table.find(column_names.TIME):
        return _joined(table, [column])
    if (column := table.find(column_names.DATE)) and _all_like(table, column, DAY_WITH_CLOCK):
        return _joined(table, [column])
    return _of_parts(table) or _joined(table, [table.require(column_names.TIME[:3], key)])


def _day_and_clock(table: Table) -> list[str]:
    """Columns of days and of times of the day, if the cells are so."""
    day, clock = table.find(column_names.DATE), None
    for name in (*column_names.CLOCK, *filter(_zone, table.cells)):
        column = table.find([name])
        if column and column != day and _all_like(table, column, r"\d{1,2}[:.h]\d{2}.*|\d{3,4}"):
            clock = column
            break
    if day is None or clock is None or _all_like(table, day, DAY_WITH_CLOCK):
        return []
    if not _all_like(table, day, r"[^\s]*\d[^\s:]*|\d{1,2} \w+ \d{4}"):
        return []
    return [day, clock]


def _all_like(table: Table, column: str, pattern: str) -> bool:
    filled = table.text(column)[table.text(column) != ""]
    return bool(len(filled)) and bool(filled.str.fullmatch(pattern).all())


def _joined(table: Table, columns: list[str]) -> Times:
    text = table.text(columns[0])
    for name in columns[1:]:
        # A clock of four digits, as in 0630, and one with an h.
        clock = table.text(name).str.replace(r"^(\d?\d)[h.](\d\d)", r"\1:\2", regex=True)
        clock = clock.str.replace(r"^(\d{1,2})(\d\d)$", r"\1:\2", regex=True)
        text = (text + " " + clock).str.strip()
    zones = [zone for name in columns if (zone := _zone(name))]
    return Times(text.rename(TOGETHER.join(columns)), zones[0] if zones else None)


def _of_parts(table: Table) -> Times | None:
    """A day with hours, or year, month and day or day of the year; hour and minute, or both."""
    year, date = table.find(column_names.YEAR), table.find(column_names.DATE)
    whole_hour = table.find(column_names.HOUR)
    if date and whole_hour and not year and _all_like(table, whole_hour, r"\d{1,2}"):
        minute = table.find(column_names.MINUTE)
        clock = _whole(table, whole_hour, 2) + ":" + (_whole(table, minute, 2) if minute else "00")
        names = [date, whole_hour, *([minute] if minute else [])]
        return Times((table.text(date) + " " + clock).rename(TOGETHER.join(names)), None)
    day_of_year = table.find(column_names.DAY_OF_YEAR)
    month, day = table.find(column_names.MONTH), table.find(column_names.DAY_OF_MONTH)
    if year is None or not (day_of_year or (month and day)):
        return None
    hour, minute = table.find(column_names.HOUR), table.find(column_names.MINUTE)
    four_digits = table.find(("hhmm", "time"))
    if hour is None and four_digits is None:
        return None
    if day_of_year:
        names = [year, day_of_year]
        written = _whole(table, year, 4) + _whole(table, day_of_year, 3)
        days = pd.to_datetime(written, format="%Y%j", errors="coerce")
        _complete(table, days, day_of_year)
        text = days.dt.strftime("%Y-%m-%d")
    else:
        names = [year, str(month), str(day)]
        text = _whole(table, year, 4)
        text = text + "-" + _whole(table, names[1], 2) + "-" + _whole(table, names[2], 2)
    if hour is not None:
        names += [hour, *([minute] if minute else [])]
        minutes = _whole(table, minute, 2) if minute else "00"
        text = text + " " + _whole(table, hour, 2) + ":" + minutes
    else:
        names.append(str(four_digits))
        four = _whole(table, str(four_digits), 4)
        text = text + " " + four.str[:2] + ":" + four.str[2:]
    return Times(text.rename(TOGETHER.join(names)), None)


def _whole(table: Table, column: str, digits: int) -> pd.Series:
    """Whole numbers as text with noughts before them."""
    values = table.text(column).map(table_numbers.plain).astype(float)
    _complete(table, values.where((values >= 0) & (values % 1 == 0)), column)
    return values.astype(int).astype(str).str.zfill(digits)


def _complete(table: Table, values: pd.Series, column: str) -> None:
    if (wrong := values.isna()).any():
        line = values.index[wrong][0]
        raise InputError(
            f"{table.path}, column {column!r}, line {line}",
            f"'{table.text(column)[line]}'",
            "a whole number, as a part of a time",
            "Correct the cell.",
        )


def _zone(name: str) -> str | None:
    """The zone in the name of a column: `time_utc`, `Time (UTC+1)`, `Zeit [MEZ]`, `TIME, GMT`."""
    found = re.search(
        r"(?:^|[\s_(\[,]+)([A-Za-z]{1,5}(?:[+\-−]\d{1,2}(?::?\d\d)?)?)[)\]]?$", name.strip()
    )
    if found is None or found[1].lower() in ("m", "s", "h", "z", "t", "time", "date"):
        return None
    try:
        timezones.find_timezone(found[1])
    except InputError:
        return None
    return found[1]
