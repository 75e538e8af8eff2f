"""The PAR sensors."""

from __future__ import annotations

from typing import Literal

from dapple.config.base import FREY, Count, NotNegative, Positive, Section, key


class Sensors(Section):
    """Horizontal PAR sensors."""

    kind: Literal["grid", "table", "none"] = key(
        "grid", "a grid around the stem, a file, or no light"
    )
    path: str = key("", "CSV with label, X, Y, Z, relative to data_dir")
    columns: Count = key(9, "grid: sensors from west to east")
    rows: Count = key(8, "grid: sensors from south to north")
    spacing_m: Positive = key(1.0, "grid: distance between neighbours", FREY)
    height_m: NotNegative = key(0.1, "grid: height above the ground")
