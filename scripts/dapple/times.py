"""The times of a run: aware of their zone, or an error; nothing is guessed."""

import re
from collections.abc import Sequence
from datetime import datetime, tzinfo
from pathlib import Path

import numpy as np
import pandas as pd

from dapple import clock, time_formats, timezones
from dapple.errors import InputError

# An offset or an abbreviation behind a time: Z, +02:00, +0200, UTC+1, MEZ. A number needs a time of
# day before it: the year of 10-08-2023 is no offset.
OFFSET = (
    r"(?:(?:(?<=:\d\d)|(?<=[.,]\d{3})|(?<=[.,]\d{6}))\s*"
    r"(?P<offset>[+\-−]\d{2}:?\d{2}|(?<=\d:\d\d:\d\d)[+\-−]\d{2})|"
    r"(?<=\d)\s*(?P<name>(?:UTC|GMT)[+\-−]\d{1,2}(?::\d\d)?|(?!AM|PM|am|pm|Uhr)[A-Za-z]{2,5}|Z))$"
)


STAMP = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d"
MOST_OFFSETS = 4
"""Of one table: 10:00-10:10 is an interval, and its end is no offset."""
AHEAD = {"start": 0.5, "middle": 0.0, "instant": 0.0, "end": -0.5}
"""From a stamp to the middle of its interval, in intervals, by what the stamp marks."""


def utc(times: object, where: str | Path = "times") -> pd.DatetimeIndex:
    """Convert times that know their zone to UTC.

    Parameters
    ----------
    times : array-like of timestamps
        Time-zone aware.
    where : str or path
        The file or key, for messages.

    Raises
    ------
    InputError
        The times are naive.
    """
    index = pd.DatetimeIndex(times)
    if index.tz is None:
        raise _naive(str(where), index[0] if len(index) else "")
    return index.tz_convert("UTC").as_unit("ns")


def parse(
    column: pd.Series,
    where: str | Path,
    timezone: str | None = None,
    *,
    time_format: str = "",
    group: pd.Series | None = None,
) -> pd.DatetimeIndex:
    """Parse a text column of times.

    ISO 8601 and stamps such as 202308101030, 20230810:1030, 10.08.2023 10:30 and, where a day
    above 12 or the step between rows tells day from month, 8/10/2023 10:30 and 10/8/23 10:30 PM.
    24:00 is the next midnight.

    Parameters
    ----------
    column : pandas.Series of str
        A time with an offset or abbreviation (`…Z`, `…+02:00`, `… MEZ`) is taken at its word; a
        column whose name ends in `_utc` is UTC where no zone is declared.
    where : str or path
        The file, for messages.
    timezone : str or None
        Zone of times without an offset.
    time_format : str
        How times are written, in the letters of `strftime`, or `epoch` (seconds since 1970) or
        `excel` (days since 1900); empty: as they show.
    group : pandas.Series or None
        Series to which rows belong (a sensor each), each in the order of time, so that the hour
        that the end of summer time repeats can be told apart.

    Returns
    -------
    pandas.DatetimeIndex
        UTC.

    Raises
    ------
    InputError
        Not a time, a day and a month that cannot be told apart, no zone, an unknown zone, or an
        hour that the clock skipped or repeated.
    """
    where = f"{where}, column {column.name!r}"
    text = column.astype(str).str.strip()
    if (empty := text.str.lower().isin(("", "nan", "nat"))).any():
        line = column.index[empty][0]
        raise InputError(
            f"{where}, line {line}", "empty times", "a time in each row", "Remove these rows."
        )
    bare, offset_min = _offsets(text, where)
    naive = time_formats.naive(bare, where, time_format)
    if time_format == "epoch":
        return (naive.tz_localize("UTC")).as_unit("ns")
    name = timezone or ("UTC" if str(column.name).lower().endswith("_utc") else None)
    aware = offset_min.notna().to_numpy()
    if aware.all():
        return _shifted(naive, offset_min).tz_localize("UTC").as_unit("ns")
    if name is None:
        raise _naive(
            where, naive[~aware][0], " beside others with an offset" if aware.any() else ""
        )
    zone = timezones.find_timezone(name, where)
    known = pd.Series(_shifted(naive, offset_min), index=column.index)
    groups = pd.Series(0, index=column.index) if group is None else group
    for _, rows in known[~aware].groupby(groups[~aware], sort=False):
        local = _localize(pd.DatetimeIndex(rows), zone, where, name)
        known.loc[rows.index] = local.tz_convert("UTC").tz_localize(None)
    return pd.DatetimeIndex(known).tz_localize("UTC").as_unit("ns")


def _naive(where: str, time: object, beside: str = "") -> InputError:
    return InputError(
        where,
        f"the naive timestamp {time}{beside}".strip(),
        "a time zone",
        "Declare the zone in which the times were written as `timezone` of this table, for example "
        "'UTC' or 'Europe/Berlin', or write the offset into them (2023-08-10T12:30:00+02:00).",
    )


def _offsets(text: pd.Series, where: str) -> tuple[pd.Series, pd.Series]:
    """Times without what they say of their zone, and minutes east of Greenwich, or NaN."""
    spelled_out = text.str.extract(OFFSET)
    zone = spelled_out["offset"].fillna(spelled_out["name"])
    minutes = pd.Series(np.nan, index=text.index)
    if zone.nunique() > MOST_OFFSETS:
        raise InputError(
            where,
            f"{text.iloc[0]}, {text.iloc[1]} and more, with {zone.nunique()} different offsets",
            "one time in each cell",
            "Where a cell holds the start and the end of an interval, keep the start and set "
            "`interval_label: start`.",
        )
    for spelled in zone.dropna().unique():
        found = timezones.find_timezone(spelled, where).utcoffset(datetime(2023, 1, 1))
        minutes[zone == spelled] = found.total_seconds() / 60.0 if found is not None else np.nan
    return text.str.replace(OFFSET, "", regex=True), minutes


def _shifted(naive: pd.DatetimeIndex, offset_min: pd.Series) -> pd.DatetimeIndex:
    return naive - pd.to_timedelta(offset_min.fillna(0.0).to_numpy(), unit="min")


def _localize(index: pd.DatetimeIndex, zone: tzinfo, where: str, name: str) -> pd.DatetimeIndex:
    """Wall-clock times in their zone; the hour that autumn repeats is told apart by its order."""
    try:
        return index.tz_localize(zone, ambiguous="infer")
    except ValueError as error:
        seasons = (pd.Timestamp(2023, month, 1, tz=zone) for month in (1, 7))
        offset = min(seasons, key=lambda day: day.utcoffset()).strftime("%z")
        raise InputError(
            where,
            "a time that daylight saving makes ambiguous or skips "
            f"({stamp[0] if (stamp := re.search(STAMP, str(error))) else error})",
            f"wall-clock times that exist once in {name}",
            "If the clock stayed on winter time, declare its offset, here "
            f"'{offset[:3]}:{offset[3:]}'; else write the times in UTC.",
        ) from error


def time_range(start: str, end: str, step_min: float, timezone: str) -> pd.DatetimeIndex:
    """The times of `clock.time_range` as an index."""
    return pd.DatetimeIndex(clock.time_range(start, end, step_min, timezone)).as_unit("ns")


def spread(times: pd.DatetimeIndex, wanted: Sequence[str], count: int, timezone: str) -> np.ndarray:
    """Indices of the times nearest to the wanted ones, or of `count` evenly spread ones.

    Parameters
    ----------
    times : (t,) DatetimeIndex
        UTC.
    wanted : texts
        On the clock of `timezone` unless they carry an offset.
    count : int
        How many, where none is wanted.
    timezone : str
        IANA name or offset.
    """
    if len(wanted):
        stamps = parse(pd.Series(list(map(str, wanted)), name="wanted"), "times", timezone)
        return np.unique(times.get_indexer(stamps, method="nearest"))
    inner = np.linspace(0, len(times) - 1, count + 2)[1:-1]
    return np.unique(inner.round().astype(int))


def hourly(times: pd.DatetimeIndex, timezone: str, fewest: int = 4) -> np.ndarray:
    """Indices of the times nearest to the full hours of one day, the one in the middle.

    Parameters
    ----------
    times : (t,) DatetimeIndex
        UTC, ascending.
    timezone : str
        IANA name or offset, by which hours and days are told.
    fewest : int
        Where there are fewer hours, so many times are spread instead.
    """
    local = times.tz_convert(timezones.find_timezone(timezone))
    day = local[len(local) // 2].normalize()
    own = np.flatnonzero(local.normalize() == day)
    hours = pd.date_range(local[own[0]].ceil("h"), local[own[-1]].floor("h"), freq="h")
    if len(hours) < fewest:
        return own[spread(times[own], (), min(fewest, len(own)), timezone)]
    return np.unique(own[local[own].get_indexer(hours, method="nearest")])
