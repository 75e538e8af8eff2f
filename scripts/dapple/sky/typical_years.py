"""Typical years: months of several years put together, as for the planning of buildings."""

from dataclasses import replace

import pandas as pd

from dapple import findings
from dapple.sky.radiation_table import Radiation
from dapple.times import utc

MORE_THAN_A_YEAR = pd.Timedelta(days=370)
OF_ONE_YEAR = 0.95
"""Share of a month's rows; in UTC its first or last hours may be those of another year."""


def is_typical(index: pd.DatetimeIndex) -> bool:
    """Whether times are those of twelve months, each of one year, that do not follow one another.

    Parameters
    ----------
    index : (n,) DatetimeIndex
        UTC.
    """
    if not len(index) or index.max() - index.min() < MORE_THAN_A_YEAR:
        return False
    rows = pd.crosstab(index.month, index.year)
    return bool(len(rows) == 12 and (rows.max(axis=1) > OF_ONE_YEAR * rows.sum(axis=1)).all())


def in_year_of(radiation: Radiation, times: pd.DatetimeIndex) -> Radiation:
    """A typical year moved to the year of the wanted times, month by month, with a warning.

    The sun of a day differs between years by less than its change in a day.
    """
    if not len(times):
        return radiation
    wanted = utc(times)
    year = int(wanted[len(wanted) // 2].year)
    middles = radiation.middles()
    own, moved = (
        pd.to_datetime(pd.DataFrame({"year": years, "month": middles.month, "day": 1}), utc=True)
        for years in (middles.year, year)
    )
    index = radiation.table.index + pd.TimedeltaIndex(moved - own)
    table = radiation.table.set_axis(index, axis="index")
    table = table[~table.index.duplicated()].sort_index()
    usual = pd.crosstab(middles.month, middles.year).idxmax(axis=1)
    text = f"a typical year, made of months of {usual.min()} to {usual.max()}, taken for {year}"
    doubt = findings.warning(
        radiation.where, text, "", "Its weather is usual, and not that of the day."
    )
    return replace(radiation, table=table, findings=(*radiation.findings, doubt))
