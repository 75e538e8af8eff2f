"""Ordered scans (PTX, E57): the shots that met nothing are there, but their directions are not.

A missing direction is taken from the grid: azimuth runs with the column, zenith with the row. Each
is a straight line fitted to the columns (rows) that have returns, plus what single columns deviate
from it, interpolated between them. Beyond the outermost column with returns the straight line goes
on, with the deviation of the last column: single noisy columns never set the slope.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dapple.cloud.lattice import spherical
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import clouds
from dapple.formats.ordered_scan import OrderedScan
from dapple.formats.shots import Shots

UPRIGHT = np.eye(3)
LEAST_RETURNS = 5
"""Columns and rows with fewer returns do not take part in the fit."""


def shots_from_file(
    path: str | Path,
    origin_m: np.ndarray,
    *,
    unit_m: float = 1.0,
    turn: np.ndarray = UPRIGHT,
    lowest_miss_zenith_deg: float = 100.0,
) -> Iterator[tuple[Shots, dict]]:
    """Shots of a file of ordered scans, scan by scan, those without return included.

    Parameters
    ----------
    path : str or Path
        PTX or E57.
    origin_m : (3,) array_like
        World coordinates of the local origin [m], as of the cloud.
    unit_m : float
        Metres of a unit of the file.
    turn : (3, 3) array_like
        Rotation from the axes of the file to east, north, up.
    lowest_miss_zenith_deg : float
        Shots without a return that point further down are left out: something nearer than the
        least range stood in the way.

    Yields
    ------
    shots : Shots
        Column by column; scans numbered as in the file.
    facts : dict
        Counts, share of misses, steps and residuals of the grid. A scan that has almost no return
        gives no shots: where it looked is not known, and it says nothing of the tree.

    Raises
    ------
    InputError
        A damaged file, or a scan whose directions are no grid.
    """
    for number, scan in clouds.ordered_scans(path):
        try:
            yield shots_of_grid(
                scan.in_metres(unit_m, turn),
                number,
                np.asarray(origin_m, float),
                lowest_miss_zenith_deg=lowest_miss_zenith_deg,
                source=f"{path}, scan {number}",
            )
        except EmptyCloudError as error:
            yield Shots.none(origin_m), {"scan": number, "skipped": error.found}


def shots_of_grid(
    scan: OrderedScan,
    number: int,
    origin_m: np.ndarray,
    *,
    lowest_miss_zenith_deg: float = 100.0,
    source: str | Path = "scan",
) -> tuple[Shots, dict]:
    """The shots of one ordered scan; see `shots_from_file`.

    Columns run in azimuth and rows in zenith; where that does not fit, the other way round.
    """
    zenith, azimuth, range_m = spherical(scan.xyz_m)
    scan, columns, rows = _fitted(scan, (zenith, azimuth, range_m), source)
    order = np.lexsort((range_m, scan.cell))
    cell, first = np.unique(scan.cell[order], return_index=True)
    last = np.append(first[1:], len(order)) - 1
    n_cells = scan.shape[0] * scan.shape[1]
    # The farthest return tells the direction best: its rounding counts least.
    direction = _grid_directions(rows.angle, columns.angle).reshape(-1, 3)
    farthest = order[last]
    direction[cell] = scan.xyz_m[farthest] / range_m[farthest, None]
    direction = direction @ scan.rotation.T
    count = np.zeros(n_cells, np.int64)
    count[cell] = np.diff(np.append(first, len(order)))
    kept = (count > 0) | (direction[:, 2] >= np.cos(np.radians(lowest_miss_zenith_deg)))
    n_returns = count[kept]
    unknown = np.full(len(order), np.nan, np.float32)
    shots = Shots(
        np.broadcast_to(scan.position_m - origin_m, (len(n_returns), 3)),
        direction[kept],
        np.full(len(n_returns), number, np.uint16),
        np.concatenate([[0], np.cumsum(n_returns)]),
        range_m[order],
        scan.attributes.get("Reflectance", unknown)[order].astype(np.float32),
        scan.attributes.get("Deviation", unknown)[order].astype(np.float32),
        np.asarray(origin_m, float),
    )
    misses = int((n_returns == 0).sum())
    facts = {
        "scan": number,
        "n_shots": len(shots),
        "n_misses": misses,
        "share_of_misses": misses / len(shots),
        "n_blocked": int((~kept).sum()),
        "azimuth_step_deg": float(np.degrees(columns.step)),
        "zenith_step_deg": float(np.degrees(rows.step)),
        "azimuth_residual_deg": columns.residual_deg,
        "zenith_residual_deg": rows.residual_deg,
    }
    return shots, facts


def _fitted(
    scan: OrderedScan, places: tuple[np.ndarray, np.ndarray, np.ndarray], source
) -> tuple[OrderedScan, "_Angle", "_Angle"]:
    """The scan with its columns in azimuth, and the angles of its columns and rows."""
    try:
        return scan, *_fit_grid(scan, *places, source)
    except EmptyCloudError:
        raise
    except InputError as error:
        try:
            return scan.transposed(), *_fit_grid(scan.transposed(), *places, source)
        except InputError:
            raise error from None


def _fit_grid(scan: OrderedScan, zenith, azimuth, range_m, source) -> tuple["_Angle", "_Angle"]:
    """Azimuth of every column and zenith of every row."""
    usable = np.sin(zenith) > 0.25  # azimuth is vague near the axis
    around = _on_grid(scan, azimuth, range_m)
    down = _on_grid(scan, zenith, range_m)
    good = np.isfinite(around)
    good[scan.column, scan.row] &= usable
    columns = _fit_angle(around, good, 2 * np.pi, source, "azimuth", "columns")
    rows = _fit_angle(down.T, good.T, None, source, "zenith", "rows")
    return columns, rows


def _on_grid(scan: OrderedScan, values: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """(columns, rows) the value of the farthest return of every shot, NaN without return."""
    grid = np.full(scan.shape, np.nan)
    order = np.argsort(range_m, kind="stable")
    grid[scan.column[order], scan.row[order]] = values[order]
    return grid


@dataclass(frozen=True)
class _Angle:
    angle: np.ndarray  # of every column (or row) [rad]
    step: float
    residual_deg: float  # 95th percentile


def _grid_directions(zenith: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """(columns, rows, 3) unit vectors in the scanner's frame."""
    sine, cosine = np.sin(zenith), np.cos(zenith)
    return np.stack(
        [
            np.cos(azimuth)[:, None] * sine,
            np.sin(azimuth)[:, None] * sine,
            np.broadcast_to(cosine, (len(azimuth), len(zenith))),
        ],
        axis=-1,
    )


def _fit_angle(
    angle: np.ndarray, usable: np.ndarray, turn: float | None, source, what: str, named: str
) -> _Angle:
    """The angle of every first index of `angle` (n, m), from the usable entries of each."""
    index = np.flatnonzero(usable.sum(axis=1) >= LEAST_RETURNS)
    if len(index) < 3:
        raise EmptyCloudError(
            source,
            f"{len(index)} {named} with at least {LEAST_RETURNS} returns",
            "at least 3, to find the directions of shots without return",
            "Leave this scan out.",
        )
    middle = np.array([_middle(angle[k][usable[k]], turn) for k in index])
    step = _first_step(index, middle, turn)
    straight = middle[0] + step * (index - index[0])
    for _ in range(10):
        off = _short_way(middle - straight, turn)
        spread = max(1.5 * np.median(np.abs(off - np.median(off))), 1e-9)
        weight = np.minimum(1.0, 2 * spread / np.maximum(np.abs(off - np.median(off)), 1e-12))
        slope, level = np.polyfit(index - index[0], off, 1, w=np.sqrt(weight))
        straight = straight + level + slope * (index - index[0])
        step += slope
    off = _short_way(middle - straight, turn)
    everything = np.arange(len(angle))
    fitted = straight[0] + step * (everything - index[0]) + np.interp(everything, index, off)
    rest = _short_way(angle - fitted[:, None], turn)[usable]
    p95 = float(np.percentile(np.abs(rest), 95))
    if p95 > abs(step):
        raise InputError(
            source,
            f"{what} {np.degrees(p95):.3f}° (95th percentile) off its grid of "
            f"{np.degrees(abs(step)):.3f}°",
            f"directions on a regular grid of {named}",
            "Export the scan as it was measured: not resampled, cleaned, or merged from faces.",
        )
    return _Angle(fitted, step, float(np.degrees(p95)))


def _middle(values: np.ndarray, turn: float | None) -> float:
    """Median, around the circular mean where angles wrap."""
    if turn is None:
        return float(np.median(values))
    mean = float(np.angle(np.exp(1j * values).mean()))
    return mean + float(np.median(_short_way(values - mean, turn)))


def _short_way(difference: np.ndarray, turn: float | None) -> np.ndarray:
    return difference if turn is None else (difference + turn / 2) % turn - turn / 2


def _first_step(index: np.ndarray, middle: np.ndarray, turn: float | None) -> float:
    """Median step between neighbours, then over longer and longer distances."""
    step = float(np.median(_short_way(np.diff(middle), turn) / np.diff(index)))
    for reach in (4, 16, 64, 256, 1024):
        if reach < len(index):
            apart = index[reach:] - index[:-reach]
            rest = _short_way(middle[reach:] - middle[:-reach] - step * apart, turn)
            step += float(np.median(rest / apart))
    return step
