"""Tables that the run itself writes and reads again: CSV for people, Parquet for many rows."""

from pathlib import Path

import pandas as pd

from dapple.errors import InputError
from dapple.formats.atomic import atomic

TEXT = ("sensor", "label", "part", "failed")
"""Columns of labels: `3_10` and `0.10` are no numbers."""
DIGITS = "%.6g"
"""More digits than any number in these tables is known to."""


def write(path: str | Path, table: pd.DataFrame, digits: str | None = DIGITS) -> None:
    """Write a table without its index, whole or not at all.

    Parameters
    ----------
    path : path
        Parquet where it ends in `.parquet`, else CSV.
    table : DataFrame
    digits : str or None
        Format of numbers with a fraction in CSV; None: as many digits as tell them apart.
    """
    with atomic(path) as partial:
        if partial.suffix == ".parquet":
            table.to_parquet(partial, index=False)
        else:
            table.to_csv(partial, index=False, float_format=digits)


def read(path: str | Path) -> pd.DataFrame:
    """Read a table as `write` writes it: labels as text, `time` in UTC.

    Raises
    ------
    InputError
        No such file, or a CSV file without a header.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "a table", "Run the step that makes it.")
    if path.suffix == ".parquet":
        return pd.read_parquet(path)
    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(TEXT, str))
    except pd.errors.EmptyDataError as error:
        raise InputError(path, "nothing", "a table", "Delete it and run again.") from error
    if "time" in table:
        table["time"] = pd.to_datetime(table["time"], utc=True)
    return table
