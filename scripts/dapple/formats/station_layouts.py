"""Layouts of national networks of radiation stations: KNMI's hours, SURFRAD, NREL's MIDC."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from dapple.errors import InputError
from dapple.formats.text_table import JOINED_TIME, Table, build, there

SURFRAD = (
    *("year", "day_of_year", "month", "day", "hour", "minute", "decimal_hour", "zenith"),
    *("global", "global_flag", "reflected", "reflected_flag"),
    *("direct", "direct_flag", "diffuse", "diffuse_flag"),
)
"""The first of 48 columns (README of the archive, NOAA Global Monitoring Laboratory)."""


def knmi(path: Path, lines: Sequence[str]) -> Table | None:
    """KNMI's hourly text: Q in J cm⁻² over hours 1 to 24, each stamped with its end, UTC."""
    header = next((k for k, line in enumerate(lines[:200]) if _is_knmi(line)), None)
    if header is None:
        return None
    table = build(path, lines, header=header, delimiter=",", layout="KNMI")
    days = pd.to_datetime(table.cells["YYYYMMDD"], format="%Y%m%d", errors="coerce")
    hours = pd.to_numeric(table.cells["HH"], errors="coerce")
    stamps = days + pd.to_timedelta(hours.where(hours.between(1, 24)), unit="h")
    if (wrong := stamps.isna()).any():
        first = table.cells[wrong].iloc[0]
        raise InputError(
            f"{path}, line {stamps.index[wrong][0]}",
            f"day {first['YYYYMMDD']!r} and hour {first['HH']!r}",
            "a day as 20230810 and an hour from 1 to 24",
            "Download the file again.",
        )
    known = there(table, **{"global": "Q"})
    return replace(
        table,
        cells=table.cells.assign(**{JOINED_TIME: stamps.dt.strftime("%Y-%m-%d %H:%M")}),
        units=dict.fromkeys(known.values(), "J/cm2"),
        timezone="UTC",
        interval_label="end",
        interval_min=60.0,
        known=known | {"time": JOINED_TIME},
    )


def _is_knmi(line: str) -> bool:
    names = [name.strip() for name in line.lstrip("# ").split(",")]
    return names[:3] == ["STN", "YYYYMMDD", "HH"]


def surfrad(path: Path, lines: Sequence[str]) -> Table | None:
    """NOAA's SURFRAD, a file a day: 48 columns without names, UTC; a flag but 0 is a doubt."""
    place = r"^\s*-?[\d.]+\s+-?[\d.]+\s+-?\d+\s+m\s+version\s+\d+"
    if len(lines) < 3 or not re.match(place, lines[1]):
        return None
    width = len(lines[2].split())
    names = [*SURFRAD, *(f"other_{k}" for k in range(len(SURFRAD), width))]
    if width < len(SURFRAD):
        raise InputError(
            f"{path}, line 3", f"{width} columns", "a day of 48 columns", "Download it again."
        )
    header = [lines[0], " ".join(names)]
    table = build(path, [*header, *lines[2:]], header=1, delimiter=" ", layout="SURFRAD")
    time = [table.cells[name].str.zfill(2) for name in SURFRAD[:6]]
    stamps = time[0] + "-" + time[2] + "-" + time[3] + " " + time[4] + ":" + time[5]
    known = {role: role for role in ("global", "diffuse")}
    certain = {
        role: table.cells[role].where(table.cells[f"{role}_flag"].isin(("0", "0.0")), "")
        for role in known
    }
    return replace(
        table,
        cells=table.cells.assign(**{JOINED_TIME: stamps}, **certain),
        units=dict.fromkeys(known, "W/m2"),
        timezone="UTC",
        known=known | {"time": JOINED_TIME},
        decimal=".",
    )


def midc(path: Path, lines: Sequence[str]) -> Table | None:
    """NREL's Measurement and Instrumentation Data Center: American days, standard time."""
    names = [name.strip().strip('"') for name in lines[0].split(",")]
    zones = [name for name in names if re.fullmatch(r"[AECMPH]ST|AKST|UTC|GMT", name)]
    by_day = "DATE (MM/DD/YYYY)" in names
    if not zones or not (by_day or {"Year", "DOY"} <= set(names)):
        return None
    table = build(path, lines, header=0, delimiter=",", layout="MIDC")
    clock = table.text(zones[0]).str.replace(":", "").str.zfill(4)
    if by_day:
        days = pd.to_datetime(table.text(names[0]), format="%m/%d/%Y", errors="coerce")
    else:
        number = table.text("DOY").str.zfill(3)
        days = pd.to_datetime(table.text("Year") + number, format="%Y%j", errors="coerce")
    if (wrong := days.isna()).any():
        raise InputError(
            f"{path}, line {days.index[wrong][0]}", "a row without a day", "the layout of MIDC",
            "Download the file again.",
        )  # fmt: skip
    stamps = days.dt.strftime("%Y-%m-%d ") + clock.str[:-2] + ":" + clock.str[-2:]
    known = {"time": JOINED_TIME}
    for role, word in (("global", "Global"), ("diffuse", "Diffuse")):
        found = _level(table, word)
        known |= {role: found[0]} if len(found) == 1 else {}
    return replace(
        table,
        cells=table.cells.assign(**{JOINED_TIME: stamps}),
        timezone=zones[0],
        known=known,
    )


def _level(table: Table, word: str) -> list[str]:
    """Columns of irradiance on the horizontal; those that say so, where some do."""
    power = [
        name
        for name in table.cells
        if name.startswith(word)
        and "W/m" in f"{name} {table.units.get(name, '')}"
        and not re.search(r"Normal|North|South|East|West|Tilt|Track|Lati", name)
    ]
    return [name for name in power if "Horizontal" in name] or power
