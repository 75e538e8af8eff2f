"""Layouts of radiation that models and satellites give for any place: NASA POWER, ERA5."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from dapple.errors import InputError
from dapple.formats.text_table import Table, build, there

MOST_J_M2_IN_AN_HOUR = 5.5e6
"""More than the sun gives outside the atmosphere."""


def power(path: Path, lines: Sequence[str]) -> Table | None:
    """NASA POWER, hourly: year to hour in UTC, or in the hour of the 15° that hold a place."""
    end = next((k for k, line in enumerate(lines[:80]) if line.startswith("-END HEADER-")), None)
    facts = "\n".join(lines[:end])
    if end is None or "NASA/POWER" not in facts:
        return None
    table = build(path, lines, header=end + 1, delimiter=",", layout="NASA POWER")
    names = {"global": "ALLSKY_SFC_SW_DWN", "diffuse": "ALLSKY_SFC_SW_DIFF"}
    units = {
        name: {"MJ/hr": "MJ/m2/h", "Wh/m^2": "Wh/m2"}.get(found[1], found[1])
        for name in names.values()
        if (found := re.search(rf"^{name} .*\(([^()]+)\)\s*$", facts, re.MULTILINE))
    }
    east = re.search(r"Longitude\s+(-?[\d.]+)", facts)
    zone: str | None = "UTC"
    if "in LST" in facts:
        zone = f"{round(float(east[1]) / 15.0):+03d}:00" if east else None
    return replace(
        table, units=units, timezone=zone, interval_min=60.0, known=there(table, **names)
    )


def era5(path: Path, lines: Sequence[str]) -> Table | None:
    """Series of ERA5 (Climate Data Store): J m⁻² over the hour before `valid_time`, UTC."""
    names = [name.strip() for name in lines[0].split(",")]
    if not {"valid_time", "ssrd"} <= set(names):
        return None
    table = build(path, lines, header=0, delimiter=",", layout="ERA5")
    total = pd.to_numeric(table.cells["ssrd"], errors="coerce")
    if (total > MOST_J_M2_IN_AN_HOUR).any():
        raise InputError(
            path, f"ssrd up to {total.max():.3g} J m⁻²", "sums over one hour",
            "ERA5-Land adds up from midnight on: take differences between hours.",
        )  # fmt: skip
    known = there(table, time="valid_time", **{"global": "ssrd"})
    of_sums = dict.fromkeys(("ssrd", "fdir"), "J/m2")
    return replace(
        table, units=of_sums, timezone="UTC", interval_label="end", interval_min=60.0,
        known=known,
    )  # fmt: skip
