"""Tables in JSON, as PVGIS, Open-Meteo and programs of people write them."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from dapple.errors import InputError
from dapple.formats.table_layouts import of_open_meteo, of_pvgis
from dapple.formats.text_table import Table


def recognise(path: Path, lines: Sequence[str]) -> Table | None:
    """The table of a JSON file, or None where it is no JSON.

    A list of rows, columns as lists of one length, or either of them in a service's layout.

    Raises
    ------
    InputError
        Broken JSON, or nothing in it that is a table.
    """
    if not lines[0].lstrip().startswith(("{", "[{")):
        return None
    if len(filled := [line for line in lines if line.strip()]) > 1 and all(
        line.lstrip().startswith("{") and line.rstrip().endswith("}") for line in filled
    ):
        lines = ["[", ",\n".join(filled), "]"]  # an object a line
    try:
        content = json.loads("\n".join(lines))
    except ValueError as error:
        raise InputError(
            path, f"broken JSON ({error})", "a table", "Download the file again."
        ) from error
    if isinstance(content, dict) and isinstance(outputs := content.get("outputs"), dict):
        hourly = outputs.get("hourly") or outputs.get("tmy_hourly")
        return of_pvgis(_table(path, hourly, "PVGIS"), _slope_deg(content))
    steps = [name for name in ("minutely_15", "hourly") if name in content]
    if isinstance(content, dict) and steps:
        table = _table(path, content[steps[0]], "Open-Meteo")
        return of_open_meteo(table, float(content.get("utc_offset_seconds", 0)))
    if isinstance(content, dict):
        inner = [value for value in content.values() if isinstance(value, list | dict)]
        content = inner[0] if len(inner) == 1 else content
    return _table(path, content, "JSON")


def _table(path: Path, content: Any, layout: str) -> Table:
    """Rows as objects, or an object of columns, as cells of text."""
    is_rows = isinstance(content, list) and content and all(isinstance(r, dict) for r in content)
    columns = list(content.values()) if isinstance(content, dict) else []
    is_columns = all(isinstance(one, list) for one in columns) and len({*map(len, columns)}) == 1
    if not (is_rows or is_columns):
        raise InputError(
            path, "no table in the JSON", "a list of rows, or columns of one length",
            "Download the data as CSV.",
        )  # fmt: skip
    frame = pd.DataFrame(content, dtype=object)
    cells = frame.map(lambda value: "" if value is None or value != value else str(value))
    cells.columns = cells.columns.astype(str)
    cells.index = pd.RangeIndex(1, len(cells) + 1)
    return replace(Table(path, cells), layout=layout)


def _slope_deg(content: dict[str, Any]) -> float:
    """Of the plane of PVGIS's radiation, 0 where it is not told."""
    fixed = content.get("inputs", {}).get("mounting_system", {}).get("fixed", {})
    return float(fixed.get("slope", {}).get("value", 0.0))
