"""Text tables of points: whitespace, comma or semicolon, with or without a header."""

import re
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from dapple import frames
from dapple.errors import InputError
from dapple.formats.atomic import atomic
from dapple.formats.cloud_raw import RawCloud, attribute_name

AXES = {"x": 0, "y": 1, "z": 2, "x_m": 0, "y_m": 1, "z_m": 2}


def read(path: Path) -> RawCloud:
    """Read `X Y Z` and further named columns; without a header the first three are X Y Z."""
    skip, names, separator = _layout(path)
    try:
        with warnings.catch_warnings():
            # Lines longer than the header would be cut with no more than a warning.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            table = pd.read_csv(
                path,
                sep=separator,
                skiprows=skip,
                header=None,
                names=names,
                index_col=False,
                comment="#",
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning, UnicodeDecodeError) as error:
        raise _damaged(path, str(error).strip()) from error
    for name in table.columns:
        if len(table) and table[name].dtype.kind not in "iufb":
            _name_the_bad_cell(path, table[name], skip)
    order = [next(n for n in names if AXES.get(n.lower()) == axis) for axis in range(3)]
    attributes = {
        attribute_name(name): table[name].to_numpy() for name in names if name not in order
    }
    return RawCloud(table[order].to_numpy(float), attributes=attributes)


def write(path: Path, raw: RawCloud) -> None:
    """Write a header and world coordinates, comma-separated for .csv, else by spaces."""
    world = frames.to_world(raw.xyz_m, raw.origin_m)
    columns = {name: np.round(world[:, axis], 6) for axis, name in enumerate("XYZ")}
    table = pd.DataFrame(columns | raw.attributes)
    with atomic(path) as partial:
        separator = "," if path.suffix.lower() == ".csv" else " "
        # An empty cell between spaces would shift its neighbours into its place.
        table.to_csv(partial, sep=separator, index=False, na_rep="nan")


def _layout(path: Path) -> tuple[int, list[str], str]:
    """How many lines to skip, the column names, the separator."""
    with path.open(encoding="utf-8-sig", errors="replace") as handle:
        head = [line for _, line in zip(range(50), handle, strict=False)]
    for number, line in enumerate(head):
        text = line.strip()
        if not text or (text.startswith("#") and not _has_axes(text.lstrip("# "))):
            continue
        separator = next((s for s in ";,\t" if s in text), None)
        if re.fullmatch(r"\d+", text):  # .pts files begin with the number of points
            continue
        words = _split(text.lstrip("/# "), separator)
        if _all_numbers(words):
            _at_least_three(path, words)
            names = ["X", "Y", "Z", *(f"column_{k}" for k in range(4, len(words) + 1))]
            return number, names, separator or r"\s+"
        if not _has_axes(text.lstrip("/# ")):
            raise _damaged(path, f"the columns '{text[:80]}'")
        following = next((row.strip() for row in head[number + 1 :] if row.strip()), "")
        separator = next(
            (s for s in ";,\t" if s in following), separator if not following else None
        )
        return number + 1, words, separator or r"\s+"
    return 0, ["X", "Y", "Z"], r"\s+"


def _split(text: str, separator: str | None) -> list[str]:
    return [word.strip().strip('"') for word in text.split(separator)]


def _has_axes(text: str) -> bool:
    found = {AXES.get(word.strip('"').lower()) for word in re.split(r"[\s,;]+", text)}
    return {0, 1, 2} <= found


def _all_numbers(words: list[str]) -> bool:
    try:
        [float(word) for word in words if word]
    except ValueError:
        return False
    return True


def _at_least_three(path: Path, words: list[str]) -> None:
    if len(words) < 3:
        raise _damaged(path, f"{len(words)} columns")


def _name_the_bad_cell(path: Path, column: pd.Series, skip: int) -> None:
    numbers = pd.to_numeric(column, errors="coerce")
    bad = numbers.isna() & column.notna()
    row = int(np.flatnonzero(bad)[0]) if bad.any() else 0
    raise _damaged(path, f"'{column.iloc[row]}' in column {column.name}, data row {row + 1}")


def _damaged(path: Path, found: str) -> InputError:
    return InputError(
        path,
        found,
        "a table of numbers with columns X Y Z (header optional; further columns need one)",
        "Correct the line, or export again with a header such as 'X Y Z Reflectance'.",
    )
