"""Text tables of points: any separator, with or without a header, with units, several scans."""

import re
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from dapple import frames
from dapple.formats import shot_tables, text_layout
from dapple.formats.atomic import atomic
from dapple.formats.cloud_raw import (
    Fired,
    RawCloud,
    ScanFacts,
    Source,
    Units,
    attribute_name,
    distinct,
)
from dapple.formats.text_layout import Layout

PTS_COLUMNS = ("X", "Y", "Z", "Intensity", "Red", "Green", "Blue")


FEW = 0.1
"""Of measured coordinates no more than this share are whole numbers."""


def read(path: Path) -> RawCloud:
    """Read `X Y Z` and further named columns; without a header the first three are X Y Z.

    A line that holds one number alone is the number of points that follow, as in PTS files: where
    there are several, each begins a scan, and `PointSourceId` counts them from 1.
    """
    if (fired := read_fired(path)) is not None:
        return fired.to_raw()
    layout = text_layout.find(path)
    if layout is None:
        return RawCloud(np.empty((0, 3)))
    if layout.header is None and path.suffix.lower() == ".pts" and layout.width in (4, 7):
        layout = layout.named(PTS_COLUMNS[: layout.width])
    table = read_table(path, layout)
    table, scan = _without_counts(table)
    notes: list[str] = []
    if layout.header is None and _begins_with_row_and_column(table):
        notes.append("The first two columns are taken for rows and columns of the scan.")
        further = (f"column_{k}" for k in range(6, layout.width + 1))
        layout = layout.named(("row", "column", *"XYZ", *further))
        table.columns = pd.Index(layout.names)
    order, factor, degrees = _axes(path, layout)
    columns = {}
    for name in order:
        columns[name] = _numbers(path, table[name], layout)
    others = [name for name in layout.names if name not in order]
    ours = distinct(attribute_name(name) for name in others)
    attributes = {}
    for name, found in zip(others, ours, strict=True):
        values = _attribute(table[name], name, layout.decimal, notes)
        if values is not None:
            attributes[found] = values
    if scan is not None and "PointSourceId" not in attributes:
        attributes["PointSourceId"] = scan
    xyz = np.stack([columns[name] * factor[axis] for axis, name in enumerate(order)], axis=1)
    scans: tuple[ScanFacts, ...] = ()
    if scan is not None:
        numbers, counts = np.unique(scan, return_counts=True)
        scans = tuple(ScanFacts(int(k), None, int(n)) for k, n in zip(numbers, counts, strict=True))
    notes += [
        f"Column {name} is in units of {f:g} m: turned into metres."
        for name, f in zip(order, factor, strict=True)
        if f != 1.0
    ]
    if layout.announced is not None and scan is None and len(xyz) < layout.announced:
        notes.append(
            f"The file announces {layout.announced:,} points and holds {len(xyz):,}: its copy or "
            "export may have been cut off."
        )
    units = Units(degrees=degrees)
    source = Source(len(xyz), units=units, notes=tuple(notes), scans=scans)
    return RawCloud(xyz, attributes=attributes, source=source)


def read_fired(path: Path) -> Fired | None:
    """The shots of a table of AMAPVox or HELIOS++; None where the file is another table."""
    if shot_tables.pulses_of(path) is not None:
        return shot_tables.read_helios(path)
    return shot_tables.read_amapvox(path) if shot_tables.is_amapvox(path) else None


def read_table(path: Path, layout: Layout) -> pd.DataFrame:
    """The rows of a table as the layout says, text where a column is not all numbers."""
    try:
        with warnings.catch_warnings():
            # Lines longer than the header would be cut with no more than a warning.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                path,
                sep=layout.separator,
                skiprows=layout.skip,
                header=None,
                names=layout.names,
                index_col=False,
                comment="#",
                decimal=layout.decimal,
                encoding=layout.encoding,
                encoding_errors="replace",
                low_memory=False,
            )
    except pd.errors.EmptyDataError:
        return pd.DataFrame(columns=layout.names, dtype=float)
    except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError) as error:
        raise text_layout.no_table(path, " ".join(str(error).split())[:200]) from error


def write(path: Path, raw: RawCloud) -> None:
    """Write a header and world coordinates, comma-separated for .csv, else by spaces."""
    world = frames.to_world(raw.xyz_m, raw.origin_m)
    columns = {name: np.round(world[:, axis], 6) for axis, name in enumerate("XYZ")}
    table = pd.DataFrame(columns | raw.attributes)
    with atomic(path) as partial:
        separator = "," if path.suffix.lower() == ".csv" else " "
        # An empty cell between spaces would shift its neighbours into its place.
        table.to_csv(partial, sep=separator, index=False, na_rep="nan")


def _without_counts(table: pd.DataFrame) -> tuple[pd.DataFrame, np.ndarray | None]:
    """Rows that are points, and the scan of each where lines of counts divide them."""
    if len(table.columns) < 2 or not len(table):
        return table, None
    alone = table.iloc[:, 1:].isna().all(axis=1).to_numpy()
    rows = np.flatnonzero(alone)
    if not len(rows):
        return table, None
    announced = as_numbers(table.iloc[rows, 0]).to_numpy()
    follow = np.diff(rows, append=len(table)) - 1
    if not np.array_equal(announced, follow):
        return table, None  # points that lack coordinates, and not counts
    scan = np.cumsum(alone) + (rows[0] > 0)
    return table[~alone], scan[~alone].astype(np.uint16)


def _begins_with_row_and_column(table: pd.DataFrame) -> bool:
    """Whole numbers alone in the first two columns, and none in the three behind them."""
    if (
        len(table.columns) < 5
        or not len(table)
        or any(table.dtypes.iloc[k].kind == "O" for k in range(5))
    ):
        return False
    first = table.iloc[:, :5].to_numpy(float)
    whole = (first == np.rint(first)) & (first >= 0)
    return bool(whole[:, :2].all() and whole[:, 2:].mean(axis=0).max() < FEW)


def _axes(path: Path, layout: Layout) -> tuple[list[str], np.ndarray, bool]:
    """Names of the columns of x, y and z, metres of their units, and whether they are degrees."""
    order: list[str] = []
    found = [text_layout.axis(name) for name in layout.names]
    factor, degrees = np.ones(3), False
    for axis in range(3):
        own = [(k, one) for k, one in enumerate(found) if one and one.axis == axis]
        at, one = next((pair for pair in own if pair[1].is_letter), own[0])
        order.append(layout.names[at])
        factor[axis], degrees = one.metres, degrees or one.degrees
    return order, factor, degrees


def as_numbers(column: pd.Series, decimal: str = ".") -> pd.Series:
    """Numbers of a column of text, NaN for what is none; whole numbers may be of any length."""
    if decimal != ".":
        column = column.astype(str).str.replace(decimal, ".", regex=False).where(column.notna())
    try:
        return pd.to_numeric(column, errors="coerce")
    except OverflowError:
        return pd.to_numeric(column.astype(str), errors="coerce").astype(float)


def _numbers(path: Path, column: pd.Series, layout: Layout) -> np.ndarray:
    if column.dtype.kind in "iufb":
        return column.to_numpy(float)
    numbers = as_numbers(column, layout.decimal)
    bad = np.flatnonzero((numbers.isna() & column.notna()).to_numpy())
    if len(bad):
        row = int(bad[0])
        cell = str(column.iloc[row])[:40]
        raise text_layout.no_table(path, f"'{cell}' in column {column.name}, data row {row + 1}")
    return numbers.to_numpy(float)


def _attribute(column: pd.Series, name: str, decimal: str, notes: list[str]) -> np.ndarray | None:
    """Numbers of a column that is not a coordinate; None where it is text or empty."""
    if column.isna().all():
        return None
    if column.dtype.kind in "iufb":
        return column.to_numpy()
    numbers = as_numbers(column, decimal)
    bad = np.flatnonzero((numbers.isna() & column.notna()).to_numpy())
    if not len(bad):
        return numbers.to_numpy()
    cell = re.sub(r"\s+", " ", str(column.iloc[bad[0]]))[:30]
    notes.append(f"Column {name} is left out: '{cell}' in data row {bad[0] + 1} is no number.")
    return None
