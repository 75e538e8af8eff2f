"""The shots of what a user brings: recorded in the file, or rebuilt from where scanners stood."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple import frames
from dapple.cloud import ordered, scan_windows
from dapple.cloud.ingest import shots_from_scan
from dapple.cloud.lattice import ScanFrame
from dapple.cloud.selection import UP
from dapple.errors import MissingMissesError
from dapple.formats import clouds
from dapple.formats.cloud_raw import Fired, Source
from dapple.formats.clouds import Cloud
from dapple.formats.shots import Shots

ORDERED = (".ptx", ".e57")
MOST_PLACES = 200
"""A scanner that fired from more places moved."""


def open_shots(
    path: str | Path,
    cloud: Cloud,
    source: Source,
    *,
    how: str,
    positions: str | Path,
    scan_frame: dict[str, Any],
    up: str = "z",
) -> tuple[Iterator[tuple[Shots, dict]], bool]:
    """The shots of a cloud's file, scan by scan.

    Parameters
    ----------
    path : str or Path
    cloud : Cloud
        Its points, for shots that have to be rebuilt, and the origin of the local frame.
    source : Source
        What the file says of itself.
    how : {"auto", "recorded", "scan_frame", "positions"}
        As `cloud.shots` of the configuration; auto takes what is recorded before what can be
        rebuilt.
    positions : path
        Table of scan positions; empty where there is none.
    scan_frame : dict
        Fields of `ScanFrame`, for `scan_frame`.
    up : {"z", "y", "-z"}
        Axis of the file that points up.

    Returns
    -------
    iterator of (Shots, dict)
        Shots and facts; each scan may be empty, and its facts then say why.
    moving : bool
        Shots of one scan start from different places.

    Raises
    ------
    MissingMissesError
        The file keeps no shots, and nothing is known from which to rebuild them.
    """
    unit_m, turn = source.units.horizontal_m, UP[up]
    if how in ("auto", "recorded"):
        if Path(path).suffix.lower() in ORDERED:
            if any(scan.shots for scan in source.scans):
                shots = ordered.shots_from_file(path, cloud.origin_m, unit_m=unit_m, turn=turn)
                return shots, False
        elif (fired := clouds.fired(path)) is not None:
            return one_by_one(fired.in_metres(unit_m, turn), cloud.origin_m)
    if how == "scan_frame":
        return iter([_framed(path, cloud, positions, scan_frame)]), False
    if how in ("auto", "positions"):
        table = places_of(source, positions, cloud.origin_m)
        if table is not None:
            return scan_windows.rebuild(cloud, table, source=path), False
    raise MissingMissesError(
        path,
        "points only",
        "every shot of the scanner, also those that met nothing",
        "Export PTX or a structured E57 (they keep them), or give the scanner's positions "
        "(cloud.scan_positions) or its angular frame (scan_frame), so that they can be rebuilt.",
    )


def places_of(source: Source, positions: str | Path, origin_m: np.ndarray) -> pd.DataFrame | None:
    """Where and how the scanners stood: as the table has it, else as the file does, else None."""
    if positions:
        return scan_windows.read_positions(positions, origin_m)
    if not source.scans:
        return None
    rows = []
    for scan in source.scans:
        if scan.position_m is None:
            return None
        place = zip(("x_m", "y_m", "z_m"), frames.to_local(scan.position_m, origin_m), strict=True)
        rotation = np.eye(3) if scan.rotation is None else scan.rotation
        tilt = zip(scan_windows.TILT, frames.scanner_angles_deg(rotation), strict=True)
        rows.append({"position": scan.number, **dict(place), **dict(tilt)})
    return pd.DataFrame(rows)


def one_by_one(fired: Fired, origin_m: np.ndarray) -> tuple[Iterator[tuple[Shots, dict]], bool]:
    """Shots that a file tells one by one; scans are the places that they start from."""
    start = frames.to_local(fired.origin_m, origin_m)
    _, first, place = np.unique(np.round(start, 3), axis=0, return_index=True, return_inverse=True)
    moving = len(first) > MOST_PLACES
    if moving:
        scan = np.ones(len(start), np.uint16)
    else:
        rank = np.argsort(np.argsort(first))
        scan = (rank[place.ravel()] + 1).astype(np.uint16)
        start = start[first][place.ravel()]
    unknown = np.full(len(fired.range_m), np.nan, np.float32)
    shots = Shots(
        start,
        fired.direction,
        scan,
        np.asarray(fired.first, np.int64),
        np.asarray(fired.range_m, float),
        fired.attributes.get("Reflectance", unknown).astype(np.float32),
        unknown,
        np.asarray(origin_m, float),
    )
    misses = int((shots.n_returns == 0).sum())
    facts = {
        "n_shots": len(shots),
        "n_misses": misses,
        "share_of_misses": misses / max(len(shots), 1),
        "n_returns": len(fired.range_m),
        "n_places": len(first),
    }
    return iter([(shots, facts)]), moving


def _framed(
    path: str | Path, cloud: Cloud, positions: str | Path, scan_frame: dict[str, Any]
) -> tuple[Shots, dict]:
    """One scan in the frame that the configuration has; the scanner is at the cloud's own zero
    where no table says otherwise."""
    place = frames.to_local(np.zeros(3), cloud.origin_m)
    scan = 1
    if positions:
        row = scan_windows.read_positions(positions, cloud.origin_m).iloc[0]
        place, scan = row[["x_m", "y_m", "z_m"]].to_numpy(float), int(row["position"])
    return shots_from_scan(cloud, place, ScanFrame(**scan_frame), scan=scan, source=path)
