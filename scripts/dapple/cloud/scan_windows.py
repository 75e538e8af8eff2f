"""Shots of scanners of which only the places are known: a frame of directions found for each.

The steps between shots are read from the points themselves, the window of directions is the one
that the points span, and the small errors of axes, tilt and place are fitted (`lattice`).
"""

from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple import frames
from dapple.cloud import lattice, scan_steps
from dapple.cloud.ingest import shots_from_scan
from dapple.cloud.lattice import ScanFrame
from dapple.errors import InputError
from dapple.formats import user_tables
from dapple.formats.clouds import Cloud
from dapple.formats.shots import Shots

LEAST_POINTS = 1000
"""Fewer do not show the frame of a scan."""
TILT = ("roll_deg", "pitch_deg", "yaw_deg")
PLACE = {
    "x_m": ("x_m", "x", "east", "easting"),
    "y_m": ("y_m", "y", "north", "northing"),
    "z_m": ("z_m", "z", "height", "up"),
}


def rebuild(
    cloud: Cloud,
    positions: pd.DataFrame,
    *,
    lowest_miss_zenith_deg: float = 100.0,
    source: str | Path = "cloud",
) -> Iterator[tuple[Shots, dict]]:
    """Rebuild the shots of every scan.

    Parameters
    ----------
    cloud : Cloud
        `PointSourceId`, or `GpsTime`, tells which scan a point is of.
    positions : pandas.DataFrame
        One row a scan: `position` (as `PointSourceId`, or the order in time), `x_m`, `y_m`, `z_m`
        (local frame) and, for scanners that did not stand level, `roll_deg`, `pitch_deg`,
        `yaw_deg` (see `frames.scanner_rotation`).
    lowest_miss_zenith_deg : float
        See `shots_from_scan`.
    source : str or Path
        The file to name in errors.

    Yields
    ------
    shots : Shots
    facts : dict
        As from `shots_from_scan`, with `scan`; a scan with few points gives no shots, and says so.

    Raises
    ------
    InputError
        Points of scans without a place, or a scan in which no frame shows.

    Notes
    -----
    Directions outside the window, such as open sky above every return of the scan, are not known
    and stay out.
    """
    number = scan_of_point(cloud, positions, source)
    known = set(positions["position"])
    if unknown := sorted(set(np.unique(number).tolist()) - known):
        raise InputError(
            source,
            f"points of scans {unknown[:8]} and places of scans {sorted(known)[:8]}",
            "a place for every scan",
            "Number the scans alike in the cloud (PointSourceId) and in the table of positions.",
        )
    for row in positions.to_dict("records"):
        scan = int(row["position"])
        one = cloud.select(number == scan)
        if len(one) < LEAST_POINTS:
            yield (
                Shots.none(cloud.origin_m),
                {"scan": scan, "skipped": f"{len(one)} points: the frame does not show"},
            )
            continue
        where = f"{source}, scan {scan}"
        place = np.array([row["x_m"], row["y_m"], row["z_m"]], float)
        shots, fact = shots_from_scan(
            one,
            place,
            frame_of(one.xyz_m - place, tilt_of(row), where),
            scan=scan,
            lowest_miss_zenith_deg=lowest_miss_zenith_deg,
            source=where,
        )
        yield shots, {"scan": scan} | fact


def scan_of_point(cloud: Cloud, positions: pd.DataFrame, source: str | Path) -> np.ndarray:
    """(n,) the scan of every point: `PointSourceId`, or the part of the time it is of.

    Scans follow each other with pauses: times are parted at the longest of them.
    """
    n = len(positions)
    ids = cloud.attributes.get("PointSourceId")
    if ids is not None and (n == 1 or len(np.unique(ids)) > 1):
        return ids.astype(np.int64)
    order = positions["position"].to_numpy(np.int64)
    if n == 1:
        return np.full(len(cloud), order[0])
    time = cloud.attributes.get("GpsTime")
    if time is None or len(np.unique(time[:: max(1, len(time) // 1000)])) < n:
        raise InputError(
            source,
            f"{n} scan positions, and points that do not say which of them they are from",
            "PointSourceId or GpsTime with every point",
            "Export the points with the number of their scan.",
        )
    ordered = np.sort(time)
    pauses = np.sort(np.argsort(np.diff(ordered))[-(n - 1) :])
    return order[np.searchsorted(ordered[pauses + 1], time, side="right")]


def tilt_of(row: dict[Hashable, Any]) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a row of positions [°]; 0 where it has none."""
    roll, pitch, yaw = (float(row.get(name, 0.0)) for name in TILT)
    return roll, pitch, yaw


def frame_of(xyz_m: np.ndarray, tilt_deg: tuple[float, float, float], where: str) -> ScanFrame:
    """The frame of a scan: steps as the points show them, the window that they span.

    Raises
    ------
    InputError
        No step stands out.
    """
    zenith, azimuth, _ = lattice.spherical(xyz_m @ frames.scanner_rotation(*tilt_deg))
    across = scan_steps.find_azimuth_step(azimuth)
    line = np.rint(azimuth % (2 * np.pi) / across).astype(np.int64) if across > 0 else None
    down = scan_steps.find_zenith_step(zenith, line) if line is not None else np.nan
    if not np.isfinite(down):
        raise InputError(
            where,
            "directions without a regular step between them",
            "the points of one scan by a scanner that stood level where the table has it",
            "Check the place and the numbers of the scans; give roll_deg, pitch_deg and yaw_deg "
            "with each position where scanners were tilted. The cloud must not be thinned.",
        )
    return window(zenith, azimuth, down, across, tilt_deg)


def window(
    zenith: np.ndarray,
    azimuth: np.ndarray,
    zenith_step: float,
    azimuth_step: float,
    tilt_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> ScanFrame:
    """The frame that directions span, all angles in radians but the tilt."""
    low, high = np.degrees([zenith.min(), zenith.max()])
    down, across = np.degrees([zenith_step, azimuth_step])
    turned = np.sort(np.degrees(azimuth) % 360.0)
    gaps = np.diff(turned, append=turned[0] + 360.0)
    widest = int(np.argmax(gaps))
    if gaps[widest] < 10.0:  # a wider gap is the border of the window
        start, width = 0.0, 360.0 - across
    else:
        start, width = turned[(widest + 1) % len(turned)], 360.0 - gaps[widest]
    n_zenith = round((high - low) / down) + 1
    n_azimuth = round(width / across) + 1
    return ScanFrame(
        n_zenith,
        n_azimuth,
        (low, low + (n_zenith - 1) * down),
        (start, start + (n_azimuth - 1) * across),
        tilt_deg,
    )


def read_positions(path: str | Path, origin_m: np.ndarray) -> pd.DataFrame:
    """Read a table of scan positions into the local frame.

    Columns `x`, `y`, `z` (or `x_m`, …) in the cloud's coordinates, and, where they are there,
    `position` (else the rows count from 1) and `roll_deg`, `pitch_deg`, `yaw_deg`; capitals do not
    matter.

    Raises
    ------
    InputError
        No file, no row, a column or a number is missing, or a position is there twice.
    """
    source = user_tables.read(path)
    columns = {name: source.require(aliases, "scan positions") for name, aliases in PLACE.items()}
    columns |= {name: found for name in TILT if (found := source.find([name]))}
    if (found := source.find(["position", "scan", "PointSourceId"])) is not None:
        columns["position"] = found
    table = pd.DataFrame({name: source.numbers(one).values for name, one in columns.items()})
    if "position" not in table:
        table["position"] = np.arange(1, len(table) + 1)
    if not len(table) or not np.isfinite(table.to_numpy(float)).all():
        raise InputError(
            path,
            "rows without all numbers" if len(table) else "no row",
            "one row a scan: position, x, y, z",
            "Complete the table.",
        )
    if table["position"].duplicated().any():
        raise InputError(
            path, "a position twice", "each scan once", "Number the scans as PointSourceId does."
        )
    axes = ["x_m", "y_m", "z_m"]
    places = frames.to_local(table[axes].to_numpy(float), origin_m)
    table[axes] = places
    return table.assign(position=table["position"].astype(int))
