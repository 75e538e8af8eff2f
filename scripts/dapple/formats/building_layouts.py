"""Weather for the simulation of buildings: EnergyPlus (EPW) and NREL's typical years (TMY3).

Both stamp hours 1 to 24 with their end, in standard time all year.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from dapple.errors import InputError
from dapple.formats import table_numbers
from dapple.formats.text_table import JOINED_TIME, Table, build, there
from dapple.timezones import offset_of_hours

EPW = (
    *("year", "month", "day", "hour", "minute", "sources", "dry_bulb", "dew_point", "humidity"),
    *("pressure", "extraterrestrial", "extraterrestrial_normal", "infrared"),
    *("global", "direct_normal", "diffuse"),
)
"""The first of 35 columns (EnergyPlus, Auxiliary Programs); radiation as Wh m⁻² over the row."""
EPW_HEAD = 8
"""Lines before the values."""


def epw(path: Path, lines: Sequence[str]) -> Table | None:
    """EnergyPlus weather: eight lines of facts, then columns without names."""
    if not lines[0].upper().startswith("LOCATION,") or len(lines) <= EPW_HEAD:
        return None
    width = len(lines[EPW_HEAD].split(","))
    if width < len(EPW):
        raise InputError(
            f"{path}, line {EPW_HEAD + 1}", f"{width} columns", "35, as EPW has",
            "Download the file again.",
        )  # fmt: skip
    names = [*EPW, *(f"other_{k}" for k in range(len(EPW), width))]
    named = [*lines[: EPW_HEAD - 1], ",".join(names), *lines[EPW_HEAD:]]
    table = build(path, named, header=EPW_HEAD - 1, delimiter=",", layout="EPW")
    step_min = 60.0 / _rows_an_hour(path, lines[:EPW_HEAD])
    year, month, day, hour, minute = (
        pd.to_numeric(table.cells[name], errors="coerce") for name in EPW[:5]
    )
    days = pd.to_datetime(pd.DataFrame({"year": year, "month": month, "day": day}), errors="coerce")
    # Of whole hours the minute is 0 in some files and 60 in others.
    minutes = 60.0 * (hour - 1) + (60.0 if step_min == 60.0 else minute.where(minute > 0, 60.0))
    stamps = days + pd.to_timedelta(minutes.where(hour.between(1, 24)), unit="min")
    known = {"global": "global", "diffuse": "diffuse"}
    return replace(
        table,
        cells=table.cells.assign(**{JOINED_TIME: _written(path, stamps, "day or hour")}),
        units=dict.fromkeys(known.values(), "Wh/m2"),
        timezone=_zone(path, lines[0], 8),
        interval_label="end",
        interval_min=step_min,
        known=known | {"time": JOINED_TIME},
        decimal=".",
    )


def tmy3(path: Path, lines: Sequence[str]) -> Table | None:
    """NREL's TMY3: a line of the station, names with units, American days."""
    if len(lines) < 3 or not lines[1].startswith("Date (MM/DD/YYYY),Time (HH:MM)"):
        return None
    table = build(path, lines, header=1, delimiter=",", layout="TMY3")
    date, clock = table.cells.columns[:2]
    days = pd.to_datetime(table.text(date), format="%m/%d/%Y", errors="coerce")
    hours = pd.to_numeric(table.text(clock).str.extract(r"^(\d{1,2}):00$")[0])
    stamps = days + pd.to_timedelta(hours.where(hours.between(1, 24)), unit="h")
    return replace(
        table,
        cells=table.cells.assign(**{JOINED_TIME: _written(path, stamps, "day or hour")}),
        timezone=_zone(path, lines[0], 3),
        interval_label="end",
        interval_min=60.0,
        known=there(table, **{"global": "GHI", "diffuse": "DHI"}) | {"time": JOINED_TIME},
        decimal=".",
    )


def _rows_an_hour(path: Path, head: Sequence[str]) -> int:
    """As the line `DATA PERIODS` has it; 1 where there is none."""
    line = next((line for line in head if line.upper().startswith("DATA PERIODS")), "")
    count = re.match(r"[^,]*,[^,]*,\s*(\d+)", line)
    if count is None:
        return 1
    if int(count[1]) not in (1, 2, 3, 4, 6, 12, 60):
        raise InputError(
            path, f"{count[1]} rows an hour (DATA PERIODS)", "1 to 60", "Download the file again."
        )
    return int(count[1])


def _zone(path: Path, line: str, place: int) -> str:
    """The zone in a line of facts, hours east of Greenwich."""
    facts = [cell.strip() for cell in line.split(",")]
    hours = table_numbers.plain(facts[place]) if len(facts) > place else None
    if hours is None or abs(hours) > 14:
        raise InputError(
            f"{path}, line 1",
            f"the zone {facts[place] if len(facts) > place else ''!r}",
            "hours east of Greenwich",
            "Download the file again.",
        )
    return offset_of_hours(hours)


def _written(path: Path, stamps: pd.Series, what: str) -> pd.Series:
    """Stamps as text; a row without one is refused."""
    if (wrong := stamps.isna()).any():
        raise InputError(
            f"{path}, line {stamps.index[wrong][0]}", f"no {what}", "a day, and an hour 1 to 24",
            "Download the file again.",
        )  # fmt: skip
    return stamps.dt.strftime("%Y-%m-%d %H:%M")
