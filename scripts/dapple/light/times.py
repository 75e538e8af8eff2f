"""Time with a zone, or an error: nothing in dapple guesses in which zone a clock ran."""

from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import pandas as pd

from dapple.errors import InputError


def zone(name: str, where: str | Path = "time zone") -> ZoneInfo:
    """Return the time zone of this name (as in `UTC`, `Europe/Berlin`).

    Raises
    ------
    InputError
        There is no such zone.
    """
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise InputError(
            where,
            f"time zone {name!r}",
            "a name of the IANA database, such as UTC or Europe/Berlin",
            "Check the spelling.",
        ) from error


def utc(times: object, where: str | Path = "times") -> pd.DatetimeIndex:
    """Convert times that know their zone to UTC.

    Parameters
    ----------
    times : array-like of timestamps
        Time-zone aware.
    where : str
        The file or key, for messages.

    Raises
    ------
    InputError
        The times are naive.
    """
    index = pd.DatetimeIndex(times)
    if index.tz is None:
        raise InputError(
            where,
            f"times without a time zone (first: {index[0] if len(index) else 'none'})",
            "time-zone aware times",
            "Say in which zone the clock ran, for example time_zone: UTC or Europe/Berlin.",
        )
    return index.tz_convert("UTC").as_unit("ns")


def parse(column: pd.Series, where: str | Path, time_zone: str | None = None) -> pd.DatetimeIndex:
    """Parse a text column of times.

    Parameters
    ----------
    column : pandas.Series of str
        ISO 8601. With an offset (`…Z`, `…+02:00`) it is taken at its word; a column whose name
        ends in `_utc` is UTC.
    where : path
        The file, for messages.
    time_zone : str or None
        Zone of times without an offset.

    Returns
    -------
    pandas.DatetimeIndex
        UTC.

    Raises
    ------
    InputError
        Not a time, no zone, an unknown zone, or an hour that the clock skipped or repeated.
    """
    zone_name = "UTC" if str(column.name).lower().endswith("_utc") else time_zone
    try:
        index = pd.DatetimeIndex(pd.to_datetime(column, format="ISO8601", utc=_has_offset(column)))
    except ValueError as error:
        raise InputError(
            where,
            f"{error} in column {column.name!r}",
            "times such as 2023-08-10 10:10:00",
            "Write times in ISO 8601.",
        ) from error
    if index.hasnans:
        raise InputError(
            where, f"empty times in column {column.name!r}", "a time in each row", "Remove them."
        )
    if index.tz is None and zone_name is not None:
        known = zone(zone_name, where)
        try:
            index = index.tz_localize(known, ambiguous="raise", nonexistent="raise")
        except ValueError as error:
            raise InputError(
                where,
                f"{error} in column {column.name!r}",
                f"times that exist once in {zone_name}",
                "Write them in UTC: the clock was changed in that hour.",
            ) from error
    return utc(index, f"{where}, column {column.name!r}")


def time_series(start: str, end: str, step_min: float, time_zone: str) -> pd.DatetimeIndex:
    """Times from `start` to `end`, both included where the step meets them, in UTC.

    Parameters
    ----------
    start, end : str
        ISO 8601, on the clock of `time_zone` unless they carry an offset.
    step_min : float
        Minutes between times.
    time_zone : str
        IANA zone of `start` and `end`.

    Raises
    ------
    InputError
        Not a time, an unknown zone, no positive step, or an end before the start.
    """
    ends = [
        parse(pd.Series([str(text)], name=name), f"time.{name}", time_zone)[0]
        for name, text in (("start", start), ("end", end))
    ]
    if ends[1] < ends[0] or not step_min > 0:
        raise InputError(
            "time",
            f"{ends[0]} to {ends[1]} every {step_min} min",
            "an end after the start and a positive step",
            "Exchange the ends or mend the step.",
        )
    return pd.date_range(*ends, freq=pd.Timedelta(minutes=step_min), unit="ns")


def _has_offset(column: pd.Series) -> bool:
    return bool(column.astype(str).str.contains(r"(?:Z|[+-]\d{2}:?\d{2})$", regex=True).any())
