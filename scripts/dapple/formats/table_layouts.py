"""Layouts of loggers and services that a table has by name: where the header is, what is fixed.

Campbell TOA5 and TOACI1, Onset HOBO, DWD's ten-minute and hourly radiation, BSRN (PANGAEA's text
and the station-to-archive file), NSRDB, PVGIS (hourly, typical year), FLUXNET.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from dapple.errors import InputError
from dapple.formats.text_table import Table, build

JOINED_TIME = "time"
"""Column that is made of a layout's columns of year, month, day, hour and minute."""


def recognise(path: Path, lines: Sequence[str]) -> Table | None:
    """The table of a file in one of these layouts, or None.

    Raises
    ------
    InputError
        The layout is known and the file is not as it should be.
    """
    filled = [line for line in lines[:3] if line.strip()]
    if not filled:
        return None
    found = (layout(path, lines) for layout in LAYOUTS)
    return next((table for table in found if table is not None), None)


def _toa5(path: Path, lines: Sequence[str]) -> Table | None:
    """Campbell Scientific: station, names, units, processing, then values on the logger's clock."""
    kind = lines[0].replace('"', "").split(",")[0].strip()
    if kind not in ("TOA5", "TOACI1") or len(lines) < 4:
        return None
    if kind == "TOACI1":
        return build(path, lines, header=1, delimiter=",", layout="TOACI1")
    table = build(path, lines, header=1, delimiter=",", first=4, layout="TOA5")
    units = [cell.strip().strip('"') for cell in lines[2].split(",")]
    named = {n: u for n, u in zip(table.cells.columns, units, strict=False) if u}
    return replace(table, units=named, known=_there(table, time="TIMESTAMP"))


def _hobo(path: Path, lines: Sequence[str]) -> Table | None:
    """Onset HOBO: perhaps a title, then `#`, `Date Time, GMT+01:00`, quantities with unit."""
    head = next((k for k, line in enumerate(lines[:3]) if re.search(r"Date[ -]Time", line)), None)
    if head is None or not re.match(r'^\s*"?(#|Date[ -]Time)', lines[head]):
        return None
    delimiter = max(",;\t", key=lines[head].count)
    table = build(path, lines, header=head, delimiter=delimiter, layout="HOBO")
    time = next(name for name in table.cells if re.match(r"Date[ -]Time", name))
    offset = re.search(r"(?:GMT|UTC)\s*([+-]\d{1,2}:?\d{2})?", time)
    zone = (offset[1] or "UTC") if offset else None
    units: dict[str, str] = {}
    for name in table.cells:
        unit = re.match(r"^[^,(]+,\s*([^(]+?)\s*(?:\(|$)", name)
        unit = unit or re.match(r"^[^,(]+\(([^:()]+)\)", name)
        units |= {name: unit[1]} if unit and name != time else {}
    return replace(table, units=units, timezone=zone, known={"time": time})


def _dwd(path: Path, lines: Sequence[str]) -> Table | None:
    """Deutscher Wetterdienst: sums in J cm⁻², stamped with the end of the interval."""
    names = [name.strip() for name in lines[0].split(";")]
    if names[:2] != ["STATIONS_ID", "MESS_DATUM"]:
        return None
    table = build(path, lines, header=0, delimiter=";", layout="DWD")
    for interval_min, wanted in (
        (10.0, {"global": "GS_10", "diffuse": "DS_10"}),
        (60.0, {"global": "FG_LBERG", "diffuse": "FD_LBERG"}),
    ):
        if wanted["global"] in table.cells:
            # The service wrote Central European Time before the year 2000.
            old = len(table.cells) and table.cells["MESS_DATUM"].iloc[0] < "2000"
            return replace(
                table,
                units=dict.fromkeys(wanted.values(), "J/cm2"),
                timezone="+01:00" if old else "UTC",
                interval_label="end",
                interval_min=interval_min,
                known=_there(table, time="MESS_DATUM", **wanted),
            )
    return replace(table, known=_there(table, time="MESS_DATUM"))


def _pangaea(path: Path, lines: Sequence[str]) -> Table | None:
    """PANGAEA's text of BSRN: a comment, then tabs; minutes stamped with their start, UTC."""
    if not lines[0].startswith("/*"):
        return None
    end = next((k for k, line in enumerate(lines) if line.strip().endswith("*/")), None)
    if end is None:
        raise InputError(path, "a comment without its end", "`*/`", "Copy the file again.")
    table = build(path, lines, header=end + 1, delimiter="\t", layout="PANGAEA")
    wanted = {"time": ["Date/Time"], "global": ["SWD", "Short-wave downward (GLOBAL) radiation"],
              "diffuse": ["DIF", "Diffuse radiation"]}  # fmt: skip
    known = {role: column for role, names in wanted.items() if (column := table.find(names))}
    if "global" not in known:
        return replace(table, timezone="UTC", known=known)
    return replace(table, timezone="UTC", interval_label="start", interval_min=1.0, known=known)


def _bsrn(path: Path, lines: Sequence[str]) -> Table | None:
    """BSRN's station-to-archive file, read by pvlib: minutes stamped with their start, UTC."""
    if not re.match(r"^\*[CU]\d{4}", lines[0]):
        return None
    from pvlib.iotools import read_bsrn

    try:
        data, _ = read_bsrn(path)
    except (ValueError, KeyError, IndexError) as error:
        raise InputError(
            path, f"a broken station-to-archive file ({error})", "the layout of BSRN",
            "Copy the file again, or take the text that PANGAEA offers.",
        ) from error  # fmt: skip
    cells = data[["ghi", "dhi"]].astype(str)
    cells.insert(0, JOINED_TIME, data.index.strftime("%Y-%m-%d %H:%M"))
    cells.index = pd.RangeIndex(1, len(cells) + 1)
    known = {"time": JOINED_TIME, "global": "ghi", "diffuse": "dhi"}
    units = {"ghi": "W/m2", "dhi": "W/m2"}
    return Table(path, cells, units, "BSRN", "UTC", "start", 1.0, known, ".")


def _nsrdb(path: Path, lines: Sequence[str]) -> Table | None:
    """NSRDB's Physical Solar Model: a line of facts, then year to minute; samples of a moment."""
    if not lines[0].startswith("Source,Location ID") or len(lines) < 4:
        return None
    facts = dict(zip(lines[0].split(","), lines[1].split(","), strict=False))
    table = build(path, lines, header=2, delimiter=",", layout="NSRDB")
    parts = ["Year", "Month", "Day", "Hour", "Minute"]
    if missing := [name for name in parts if name not in table.cells]:
        raise InputError(
            path, f"no column {missing[0]}", "the layout of NSRDB", "Download the file again."
        )
    year, month, day, hour, minute = (table.cells[name].str.zfill(2) for name in parts)
    time = year + "-" + month + "-" + day + " " + hour + ":" + minute
    hours = float(facts.get("Time Zone", "0") or 0.0)
    return replace(
        table,
        cells=table.cells.assign(**{JOINED_TIME: time}),
        units={"GHI": "W/m2", "DHI": "W/m2"},
        timezone=f"{hours:+03.0f}:00" if hours % 1 == 0 else f"{int(hours):+03d}:30",
        interval_min=0.0,
        known=_there(table, **{"global": "GHI", "diffuse": "DHI"}) | {"time": JOINED_TIME},
    )


def _pvgis(path: Path, lines: Sequence[str]) -> Table | None:
    """PVGIS: some lines of facts, a table, a legend; samples of a moment, UTC."""
    if not lines[0].startswith("Latitude (decimal degrees)"):
        return None
    header = next((k for k, line in enumerate(lines) if re.match(r"time(\(UTC\))?,", line)), None)
    if header is None:
        raise InputError(
            path, "no line that begins with `time`", "PVGIS's CSV", "Download it again."
        )
    end = next((k for k in range(header, len(lines)) if not lines[k].strip()), len(lines))
    table = build(path, lines[:end], header=header, delimiter=",", layout="PVGIS")
    time = str(table.cells.columns[0])
    facts: dict[str, Any] = {"timezone": "UTC", "interval_min": 0.0}
    if "G(h)" in table.cells:
        known = _there(table, **{"global": "G(h)", "diffuse": "Gd(h)"})
        return replace(table, units=dict.fromkeys(known.values(), "W/m2"),
                       known=known | {"time": time}, **facts)  # fmt: skip
    slope = re.search(r"Slope:\s*(-?[\d.]+)", "\n".join(lines[:header]))
    if slope and float(slope[1]) != 0:
        raise InputError(
            path, f"radiation on a plane that is tilted by {slope[1]}°", "on the horizontal",
            "Download it with slope 0.",
        )  # fmt: skip
    cells = table.cells
    if "Gb(i)" in cells:
        parts = (pd.to_numeric(cells[name], errors="coerce") for name in ("Gb(i)", "Gd(i)"))
        total = sum(parts).round(6)
        cells = cells.assign(**{"G(i)": total.astype(str)})
    known = {"time": time, "global": "G(i)"} | ({"diffuse": "Gd(i)"} if "Gd(i)" in cells else {})
    units = {"G(i)": "W/m2", "Gd(i)": "W/m2"}
    return replace(table, cells=cells, units=units, known=known, **facts)


def _fluxnet(path: Path, lines: Sequence[str]) -> Table | None:
    """FLUXNET, ICOS, AmeriFlux: TIMESTAMP_START and _END on local standard time, -9999 missing."""
    head = next((k for k, line in enumerate(lines[:5]) if "TIMESTAMP_START" in line), None)
    if head is None:
        return None
    table = build(path, lines, header=head, delimiter=",", layout="FLUXNET")
    wanted = {
        "global": ["SW_IN", "SW_IN_F", "SW_IN_1_1_1"],
        "diffuse": ["SW_DIF", "SW_DIF_1_1_1"],
        "par": ["PPFD_IN", "PPFD_IN_1_1_1"],
    }
    known = {role: column for role, names in wanted.items() if (column := table.find(names))}
    of_role = {"global": "W/m2", "diffuse": "W/m2", "par": "umol/m2/s"}
    units = {column: of_role[role] for role, column in known.items()}
    interval_min = None
    if len(table.cells) and "TIMESTAMP_END" in table.cells:
        ends = pd.to_datetime(
            table.cells[["TIMESTAMP_START", "TIMESTAMP_END"]].iloc[0],
            format="%Y%m%d%H%M",
            errors="coerce",
        )
        interval_min = float((ends.iloc[1] - ends.iloc[0]).total_seconds() / 60.0)
    known["time"] = "TIMESTAMP_START"
    return replace(
        table, units=units, interval_label="start", interval_min=interval_min, known=known
    )


def _there(table: Table, **columns: str) -> dict[str, str]:
    """Those of a layout's columns that a file has."""
    return {role: name for role, name in columns.items() if name in table.cells}


LAYOUTS: tuple[Callable[[Path, Sequence[str]], Table | None], ...] = (
    _toa5,
    _hobo,
    _dwd,
    _pangaea,
    _bsrn,
    _nsrdb,
    _pvgis,
    _fluxnet,
)
