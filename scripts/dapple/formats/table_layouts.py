"""Layouts of loggers and services that a table has by name: where the header is, what is fixed.

Campbell TOA5 and TOACI1, Onset HOBO, DWD's ten-minute and hourly radiation, BSRN (PANGAEA's text
and the station-to-archive file), NSRDB, PVGIS (hourly, typical year), FLUXNET, CAMS, Solcast,
Open-Meteo; and those of `station_layouts`, `building_layouts`, `logger_layouts` and
`reanalysis_layouts`.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats import table_numbers
from dapple.formats.building_layouts import epw, tmy3
from dapple.formats.logger_layouts import davis, meter
from dapple.formats.reanalysis_layouts import era5, power
from dapple.formats.station_layouts import knmi, midc, surfrad
from dapple.formats.text_table import JOINED_TIME, Table, build, there
from dapple.timezones import offset_of_hours


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
    return replace(table, units=named, known=there(table, time="TIMESTAMP"))


def _hobo(path: Path, lines: Sequence[str]) -> Table | None:
    """Onset HOBO: perhaps a title, then `#`, `Date Time, GMT+01:00`, quantities with unit."""
    head = next((k for k, line in enumerate(lines[:3]) if re.search(r"Date[ -]Time", line)), None)
    if head is None or not re.match(r'^\s*"?(#|Date[ -]Time)', lines[head]):
        return None
    delimiter = max(",;\t", key=lines[head].count)
    table = build(path, lines, header=head, delimiter=delimiter, layout="HOBO")
    time = next((name for name in table.cells if re.match(r"Date[ -]Time", name)), None)
    if time is None:
        return None
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
                known=there(table, time="MESS_DATUM", **wanted),
            )
    return replace(table, known=there(table, time="MESS_DATUM"))


def _pangaea(path: Path, lines: Sequence[str]) -> Table | None:
    """PANGAEA's text of BSRN: a comment, then tabs; minutes stamped with their start, UTC."""
    if not lines[0].startswith("/*"):
        return None
    end = next((k for k, line in enumerate(lines) if line.strip().endswith("*/")), None)
    if end is None:
        raise InputError(path, "a comment without its end", "`*/`", "Copy the file again.")
    if end + 1 == len(lines):
        raise InputError(path, "nothing but a comment", "a table below it", "Copy the file again.")
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
    hours = table_numbers.plain(facts.get("Time Zone", "0") or "0")
    if hours is None or abs(hours) > 14:
        raise InputError(
            f"{path}, line 2", f"the zone {facts['Time Zone']!r}", "hours east of Greenwich",
            "Download the file again.",
        )  # fmt: skip
    return replace(
        table,
        cells=table.cells.assign(**{JOINED_TIME: time}),
        units={"GHI": "W/m2", "DHI": "W/m2"},
        timezone=offset_of_hours(hours),
        interval_min=0.0,
        known=there(table, **{"global": "GHI", "diffuse": "DHI"}) | {"time": JOINED_TIME},
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
    slope = re.search(r"Slope:\s*(-?[\d.]+)", "\n".join(lines[:header]))
    table = build(path, lines[:end], header=header, delimiter=",", layout="PVGIS")
    return of_pvgis(table, float(slope[1]) if slope else 0.0)


def of_pvgis(table: Table, slope_deg: float) -> Table:
    """What is fixed of PVGIS's table on a plane of this slope.

    Raises
    ------
    InputError
        A tilted plane, or no column of radiation.
    """
    path = table.path
    time = str(table.cells.columns[0])
    facts: dict[str, Any] = {"timezone": "UTC", "interval_min": 0.0}
    beam = "Gb(i)" in table.cells and "Gd(i)" in table.cells
    if not beam and not {"G(h)", "G(i)"} & set(table.cells):
        raise InputError(
            path, f"columns {', '.join(table.cells)}", "G(h), G(i), or Gb(i) and Gd(i)",
            "Download it again.",
        )  # fmt: skip
    if "G(h)" in table.cells:
        known = there(table, **{"global": "G(h)", "diffuse": "Gd(h)"})
        return replace(table, units=dict.fromkeys(known.values(), "W/m2"),
                       known=known | {"time": time}, **facts)  # fmt: skip
    if slope_deg:
        raise InputError(
            path, f"radiation on a plane that is tilted by {slope_deg:g}°", "on the horizontal",
            "Download it with slope 0.",
        )  # fmt: skip
    cells = table.cells
    if beam:
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


def _cams(path: Path, lines: Sequence[str]) -> Table | None:
    """CAMS radiation service: sums in Wh m⁻² over periods that each row names, UTC."""
    head = next(
        (k for k, line in enumerate(lines[:80]) if line.startswith("# Observation period;")), None
    )
    if head is None:
        return None
    table = build(path, lines, header=head, delimiter=";", layout="CAMS")
    period = table.cells["Observation period"].str.split("/", expand=True)
    if len(period.columns) != 2 or period.isna().any(axis=None):
        raise InputError(path, "rows without a period", "CAMS's CSV", "Download it again.")
    cells = table.cells.assign(**{JOINED_TIME: period[0]})
    known = there(table, **{"global": "GHI", "diffuse": "DHI"})
    return replace(
        table,
        cells=cells,
        units=dict.fromkeys(known.values(), "Wh/m2"),
        timezone="UTC",
        interval_label="start",
        interval_min=_length_min(period[0], period[1]),
        known=known | {"time": JOINED_TIME},
    )


def _length_min(start: pd.Series, end: pd.Series) -> float | None:
    """Length of the first interval [min]."""
    first, last = pd.to_datetime([start.iloc[0], end.iloc[0]], errors="coerce", utc=True)
    # A period that ends with its last second or minute lasts until the next one begins.
    minutes = (last - first).total_seconds() / 60.0
    return float(np.ceil(minutes)) if np.isfinite(minutes) and minutes > 0 else None


def _solcast(path: Path, lines: Sequence[str]) -> Table | None:
    """Solcast: means over a period that is named by its end and its length, UTC."""
    names = [re.sub(r"[^a-z]", "", name.lower()) for name in lines[0].split(",")]
    if not {"periodend", "period"} <= set(names):
        return None
    table = build(path, lines, header=0, delimiter=",", layout="Solcast")
    column = dict(zip(names, table.cells.columns, strict=False))
    roles = {"time": "periodend", "global": "ghi", "diffuse": "dhi"}
    known = {role: column[name] for role, name in roles.items() if name in column}
    first = table.cells[column["period"]].iloc[0] if len(table.cells) else ""
    length = re.fullmatch(r"PT(\d+)(M|H)", first)
    return replace(
        table,
        units={name: "W/m2" for role, name in known.items() if role != "time"},
        timezone="UTC",
        interval_label="end",
        interval_min=float(length[1]) * {"M": 1, "H": 60}[length[2]] if length else None,
        known=known,
    )


def _open_meteo(path: Path, lines: Sequence[str]) -> Table | None:
    """Open-Meteo: two lines of facts, then means over the hour (or quarter) before the stamp."""
    if not lines[0].startswith("latitude,longitude,elevation,utc_offset_seconds") or len(lines) < 4:
        return None
    facts = dict(zip(lines[0].split(","), lines[1].split(","), strict=False))
    head = next((k for k, line in enumerate(lines[2:], start=2) if line.startswith("time,")), None)
    if head is None:
        return None
    table = build(path, lines, header=head, delimiter=",", layout="Open-Meteo")
    return of_open_meteo(table, table_numbers.plain(facts["utc_offset_seconds"]) or 0.0)


def of_open_meteo(table: Table, seconds: float) -> Table:
    """What is fixed of Open-Meteo's table, so many seconds east of Greenwich."""
    roles = {"global": "shortwave_radiation", "diffuse": "diffuse_radiation"}
    known = {role: column for role, name in roles.items() if (column := table.find([name]))}
    is_known = abs(seconds) <= 14 * 3600
    return replace(
        table,
        timezone=offset_of_hours(seconds / 3600) if is_known else None,
        interval_label="end",
        known=known | {"time": "time"},
    )


LAYOUTS: tuple[Callable[[Path, Sequence[str]], Table | None], ...] = (
    _toa5,
    _hobo,
    _dwd,
    _pangaea,
    _bsrn,
    _nsrdb,
    _pvgis,
    _fluxnet,
    _cams,
    _solcast,
    _open_meteo,
    knmi,
    surfrad,
    midc,
    meter,
    davis,
    power,
    era5,
    epw,
    tmy3,
)
