"""The times of a run: aware of their zone, or an error; nothing is guessed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from dapple import clock, frames
from dapple.errors import InputError


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
        index = frames.to_utc(index, None, str(where))
    return index.tz_convert("UTC").as_unit("ns")


def parse(column: pd.Series, where: str | Path, timezone: str | None = None) -> pd.DatetimeIndex:
    """Parse a text column of times.

    Parameters
    ----------
    column : pandas.Series of str
        ISO 8601 (day-first and month-first dates are refused, not guessed). With an offset
        (`…Z`, `…+02:00`) it is taken at its word; a column whose name ends in `_utc` is UTC.
    where : str or path
        The file, for messages.
    timezone : str or None
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
    where = f"{where}, column {column.name!r}"
    aware = bool(column.astype(str).str.contains(r"(?:Z|[+-]\d{2}:?\d{2})$", regex=True).any())
    try:
        index = pd.DatetimeIndex(pd.to_datetime(column, format="ISO8601", utc=aware))
    except ValueError as error:
        raise InputError(
            where, str(error), "times such as 2023-08-10 10:10:00", "Write times in ISO 8601."
        ) from error
    if index.hasnans:
        raise InputError(where, "empty times", "a time in each row", "Remove these rows.")
    name = "UTC" if str(column.name).lower().endswith("_utc") else timezone
    return frames.to_utc(index, name, where).as_unit("ns")


def time_range(start: str, end: str, step_min: float, timezone: str) -> pd.DatetimeIndex:
    """The times of `clock.time_range` as an index."""
    return pd.DatetimeIndex(clock.time_range(start, end, step_min, timezone)).as_unit("ns")


def spread(times: pd.DatetimeIndex, wanted: Sequence[str], count: int) -> np.ndarray:
    """Indices of the times nearest to the wanted ones, or of `count` evenly spread ones."""
    if len(wanted):
        stamps = pd.DatetimeIndex(pd.to_datetime(list(wanted), utc=True))
        return np.unique(times.get_indexer(stamps, method="nearest"))
    inner = np.linspace(0, len(times) - 1, count + 2)[1:-1]
    return np.unique(inner.round().astype(int))
