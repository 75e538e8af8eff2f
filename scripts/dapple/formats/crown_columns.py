"""Which columns of crowns name the trees and tell their chlorophyll."""

import re
from collections.abc import Sequence
from pathlib import Path

import geopandas
import numpy as np

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import column_names
from dapple.formats.table_numbers import parse

TREE_NAMES = ("tree", "tree_id", "id", "name", "label", "tree_no", "tree_nr", "tree_number",
              "tree_name", "tree_tag", "tag", "crown_id", "plot_tree", "baum", "baum_id", "baum_nr",
              "baumnummer", "arbre", "arbol")  # fmt: skip
LCC_NAMES = ("lcc_ug_cm2", "lcc", "chlorophyll", "chl", "cab")
OF_CHLOROPHYLL = re.compile(
    r"(?<![a-z])(?:lcc|cab|chl|chla|chl_?a_?\+?_?b)(?![a-z])|chlorophyll", re.IGNORECASE
)
OF_SPREAD = re.compile(r"(?<![a-z])(?:sd|std|se|cv|min|max|n)(?![a-z])", re.IGNORECASE)
"""Names of columns that may hold chlorophyll, and of those that tell how it varies."""
LARGEST_LCC_UG_CM2 = 200.0
LCC_FLAGS = (-99.0, -999.0, -9999.0)


def names(
    path: Path, frame: geopandas.GeoDataFrame, asked: str, noticed: list[Finding]
) -> tuple[str, ...]:
    column = _column(path, frame, asked, TREE_NAMES, "crowns_tree_column")
    if column is None:
        return tuple(str(number) for number in range(1, len(frame) + 1))
    names = tuple(
        str(number) if name is None else str(name).removesuffix(".0")
        for number, name in enumerate(frame[column], start=1)
    )
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        noticed.append(
            findings.warning(
                path, f"tree {repeated[0]} more than once", "each tree once",
                "Both outlines are kept; join them where they are one crown.",
            )
        )  # fmt: skip
    return names


def chlorophyll(
    path: Path, frame: geopandas.GeoDataFrame, asked: str, noticed: list[Finding]
) -> np.ndarray:
    """Measured leaf chlorophyll (n,), NaN where it is not known [µg cm⁻²]."""
    column = _column(path, frame, asked, LCC_NAMES, "crowns_lcc_column")
    if column is None:
        column = _of_chlorophyll(path, frame)
        if column is not None:
            noticed.append(findings.note(path, f"chlorophyll of the trees from {column!r}"))
    if column is None:
        noticed.append(
            findings.note(path, "no measured chlorophyll: the map is not held against trees")
        )
        return np.full(len(frame), np.nan)
    texts = frame[column].map(lambda value: "" if value is None or value != value else str(value))
    texts.index = range(1, len(texts) + 1)
    where = f"{path}, property {column!r}"
    decimal = "," if texts.str.contains(",").any() else "."
    values = parse(texts, where, decimal=decimal, flags=LCC_FLAGS).values
    wrong = (values <= 0) | (values >= LARGEST_LCC_UG_CM2)
    if wrong.any():
        number = int(np.flatnonzero(wrong)[0])
        raise InputError(
            path,
            f"{column} = {texts.iloc[number]} in feature {number + 1}",
            f"leaf chlorophyll above 0 and below {LARGEST_LCC_UG_CM2:g}, in µg cm⁻²",
            "Correct it, or leave the cell empty where it was not measured.",
        )
    return values


def _of_chlorophyll(path: Path, frame: geopandas.GeoDataFrame) -> str | None:
    """The one column whose name speaks of chlorophyll, or None.

    Raises
    ------
    InputError
        Several do, or its unit is another.
    """
    names = [str(name) for name in frame.columns if name != frame.geometry.name]
    found = [name for name in names if OF_CHLOROPHYLL.search(name) and not OF_SPREAD.search(name)]
    if len(found) > 1:
        raise InputError(
            path, f"properties {', '.join(found)}", "one of chlorophyll",
            "Name it in `crowns_lcc_column`.",
        )  # fmt: skip
    if found and re.search(r"mg", found[0], re.IGNORECASE):
        raise InputError(
            path, f"property {found[0]!r}, in milligrams", "chlorophyll in µg cm⁻²",
            "Convert it (10 mg m⁻² are 1 µg cm⁻²) and name it lcc_ug_cm2.",
        )  # fmt: skip
    return found[0] if found else None


def _column(
    path: Path, frame: geopandas.GeoDataFrame, asked: str, usual: Sequence[str], key: str
) -> str | None:
    columns = {str(name).lower(): str(name) for name in frame.columns if name != "geometry"}
    if asked:
        if asked.lower() in columns:
            return columns[asked.lower()]
        raise InputError(
            path, f"properties {', '.join(columns.values())}", f"`{asked}`", f"Correct `{key}`."
        )
    return column_names.first(usual, columns.values())
