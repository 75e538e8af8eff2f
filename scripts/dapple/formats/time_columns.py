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


A_CLOCK = r"\d{1,2}[:.h]\d{2}.*"
HOURS = r"\d{1,2}(?:[.,]\d+)?"
A_FEW_SECONDS = pd.Timedelta(seconds=6)
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
    column = table.find(column_names.TIME) or _with_zone(table)
    if column is not None:
        is_clock = _all_like(table, column, A_CLOCK)
        return (is_clock and _of_parts(table)) or _joined(table, [column])
    if (column := table.find(column_names.DATE)) and _all_like(table, column, DAY_WITH_CLOCK):
        return _joined(table, [column])
    return _of_parts(table) or _joined(table, [table.require(column_names.TIME[:3], key)])


def _with_zone(table: Table) -> str | None:
    """A column of times with a zone behind its name: `Time_CET`, `Datum MEZ`."""
    for name in table.cells:
        zone = _zone(name)
        bare = name[: name.rfind(zone)].rstrip(" _([,") if zone else ""
        known = (*column_names.TIME, *column_names.DATE)
        if bare and column_names.first(known, [bare]) and _all_like(table, name, DAY_WITH_CLOCK):
            return name
    return None


def _day_and_clock(table: Table) -> list[str]:
    """Columns of days and of times of the day, if the cells are so."""
    day, clock = table.find(column_names.DATE), None
    for name in (*column_names.CLOCK, *filter(_zone, table.cells)):
        column = table.find([name])
        if column and column != day and _all_like(table, column, A_CLOCK + r"|\d{3,4}"):
            if _has_fractions(table, column):
                return []
            clock = column
            break
    if day is None or clock is None or _all_like(table, day, DAY_WITH_CLOCK):
        return []
    if not _all_like(table, day, r"[^\s]*\d[^\s:]*|\d{1,2} \w+ \d{4}"):
        return []
    if _all_like(table, day, r"\d{1,2}"):
        return []  # of a month: year and month stand beside it
    return [day, clock]


def _has_fractions(table: Table, column: str) -> bool:
    """Whether 10.5 is half past ten: no clock with a point has 10.75 or one digit behind it."""
    if not _all_like(table, column, HOURS):
        return False
    parts = table.text(column).str.extract(r"[.,](\d+)")[0].dropna()
    return bool((parts.str.len() != 2).any() or (parts.astype(float) > 59).any())


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
    if date and whole_hour and not year and _all_like(table, whole_hour, HOURS):
        minute = table.find(column_names.MINUTE)
        clock = _clock(table, whole_hour, minute)
        names = [date, whole_hour, *([minute] if minute else [])]
        return Times((table.text(date) + " " + clock).rename(TOGETHER.join(names)), None)
    day_of_year = table.find(column_names.DAY_OF_YEAR)
    month, day = table.find(column_names.MONTH), table.find(column_names.DAY_OF_MONTH)
    if year is None or not (day_of_year or (month and day)):
        return None
    hour, minute = table.find(column_names.HOUR), table.find(column_names.MINUTE)
    four_digits = table.find(("hhmm", *column_names.CLOCK))
    if day_of_year and hour is None and four_digits is None:
        return _of_decimal_days(table, str(year), day_of_year)
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
        text = text + " " + _clock(table, hour, minute)
    else:
        clock = str(four_digits)
        names.append(clock)
        if _all_like(table, clock, r"\d{1,2}:\d\d.*"):
            text = text + " " + table.text(clock)
        else:
            four = _whole(table, clock, 4)
            text = text + " " + four.str[:2] + ":" + four.str[2:]
    zones = [zone for name in names if (zone := _zone(name))]
    return Times(text.rename(TOGETHER.join(names)), zones[0] if zones else None)


def _clock(table: Table, hour: str, minute: str | None) -> pd.Series:
    """The time of the day from hours, which may have a fraction, or hours, minutes and seconds."""
    if minute:
        text = _whole(table, hour, 2) + ":" + _whole(table, minute, 2)
        second = table.find(column_names.SECOND)
        if second is None or not _all_like(table, second, r"[0-5]?\d(?:[.,]0*)?"):
            return text
        return text + ":" + _whole(table, second, 2)
    hours = table.text(hour).str.replace(",", ".").map(table_numbers.plain).astype(float)
    if (hours.dropna() % 1 == 0).all():
        return _whole(table, hour, 2) + ":00"
    _complete(table, hours.where(hours.between(0, 24)), hour)
    return _clock_of((3600.0 * hours).round())


def _clock_of(seconds: pd.Series) -> pd.Series:
    """Seconds since midnight as 06:30:00; a whole day is 24:00:00."""
    whole = seconds.astype(int)
    parts = (whole // 3600, whole // 60 % 60, whole % 60)
    hours, minutes, rest = (part.astype(str).str.zfill(2) for part in parts)
    return hours + ":" + minutes + ":" + rest


def _of_decimal_days(table: Table, year: str, day_of_year: str) -> Times | None:
    """A year and a day of it with a fraction: 222.5 is noon of the 222nd day."""
    days = table.text(day_of_year).str.replace(",", ".").map(table_numbers.plain).astype(float)
    if not (days.dropna() % 1 > 0).any():
        return None
    _complete(table, days.where(days.between(1, 367)), day_of_year)
    first = pd.to_datetime(_whole(table, year, 4) + "-01-01")
    times = first + pd.to_timedelta((86_400.0 * (days - 1.0)).round(), unit="s")
    # Fractions are written with few digits: whole minutes are meant where all are near them.
    minutes = times.dt.round("min")
    times = minutes if (minutes - times).abs().max() <= A_FEW_SECONDS else times
    text = times.dt.strftime("%Y-%m-%d %H:%M:%S")
    return Times(text.rename(TOGETHER.join([year, day_of_year])), None)


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
