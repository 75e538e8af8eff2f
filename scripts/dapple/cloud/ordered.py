"""Ordered scans (PTX): the shots that met nothing are there, but their directions are not.

A missing direction is taken from the grid: azimuth runs with the column, zenith with the row. Each
is a straight line fitted to the columns (rows) that have returns, plus what single columns deviate
from it, interpolated between them. Beyond the outermost column with returns the straight line goes
on, with the deviation of the last column: single noisy columns never set the slope.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dapple import frames
from dapple.cloud.lattice import spherical
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import cloud_ptx
from dapple.formats import shots as shots_format
from dapple.formats.cloud_ptx import PtxScan
from dapple.formats.shots import Shots

LEAST_RETURNS = 5
"""Columns and rows with fewer returns do not take part in the fit."""


def shots_from_ptx(
    path: str | Path, *, lowest_miss_zenith_deg: float = 100.0, origin_m: np.ndarray | None = None
) -> tuple[Shots, list[dict]]:
    """Every shot of a PTX file, those without return included.

    Parameters
    ----------
    path : str or Path
        PTX file, one or more scans.
    lowest_miss_zenith_deg : float
        Shots without a return that point further down are left out: something nearer than the
        least range stood in the way.
    origin_m : (3,) array_like, optional
        World coordinates of the local origin [m]; by default the one of `clouds.read(path)`.

    Returns
    -------
    shots : Shots
        Column by column; scans numbered from 1.
    facts : list of dict
        One a scan: counts, share of misses, steps and residuals of the grid.

    Raises
    ------
    InputError
        A damaged file, or a scan whose directions are no grid.
    """
    scans = list(cloud_ptx.scans(path))
    if origin_m is None:
        origin_m = _origin(path, scans)
    parts, facts = [], []
    for number, scan in enumerate(scans, 1):
        shots, fact = shots_of_grid(
            scan,
            number,
            np.asarray(origin_m, float),
            lowest_miss_zenith_deg=lowest_miss_zenith_deg,
            source=f"{path}, scan {number}",
        )
        parts.append(shots)
        facts.append({"scan": number} | fact)
    return shots_format.concatenate(parts), facts


def shots_of_grid(
    scan: PtxScan,
    number: int,
    origin_m: np.ndarray,
    *,
    lowest_miss_zenith_deg: float = 100.0,
    source: str | Path = "scan",
) -> tuple[Shots, dict]:
    """The shots of one ordered scan; see `shots_from_ptx`."""
    hit = scan.hit
    zenith, azimuth, range_m = (
        values.reshape(hit.shape) for values in spherical(scan.xyz_m.reshape(-1, 3))
    )
    usable = hit & (np.sin(zenith) > 0.25)  # azimuth is vague near the axis
    columns = _fit_angle(azimuth, usable, 2 * np.pi, source, "azimuth", "columns")
    rows = _fit_angle(zenith.T, usable.T, None, source, "zenith", "rows")
    direction = np.where(
        hit[..., None],
        scan.xyz_m / np.where(hit, range_m, 1.0)[..., None],
        _grid_directions(rows.angle, columns.angle),
    )
    direction = direction.reshape(-1, 3) @ scan.rotation.T
    lowest = np.cos(np.radians(lowest_miss_zenith_deg))
    met = hit.ravel()
    kept = met | (direction[:, 2] >= lowest)
    n_returns = met[kept].astype(np.int64)
    unknown = np.full(int(n_returns.sum()), np.nan, np.float32)
    shots = Shots(
        np.tile(scan.position_m - origin_m, (len(n_returns), 1)),
        direction[kept],
        np.full(len(n_returns), number, np.uint16),
        np.concatenate([[0], np.cumsum(n_returns)]),
        range_m.ravel()[met],
        unknown,
        unknown,
        np.asarray(origin_m, float),
    )
    misses = int((n_returns == 0).sum())
    facts = {
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


def _origin(path: str | Path, scans: list[PtxScan]) -> np.ndarray:
    corners = []
    for scan in scans:
        if scan.hit.any():
            world = scan.xyz_m[scan.hit] @ scan.rotation.T + scan.position_m
            corners += [world.min(axis=0), world.max(axis=0)]
    if not corners:
        raise EmptyCloudError(path, "0 points", "at least one point", "Check the export.")
    return frames.choose_origin(np.array(corners))
