"""Foreign input brought into what the chain needs: shots with their misses.

Points alone do not say where the laser saw nothing, and without that plant area density has no
denominator. PTX files keep the shots that met nothing; for other files they are rebuilt from the
regular angular frame of the scanner, or the workflow stops.
"""

from pathlib import Path

import numpy as np

from dapple.cloud import lattice
from dapple.cloud.lattice import ScanFrame
from dapple.errors import EmptyCloudError, InputError
from dapple.formats.clouds import Cloud
from dapple.formats.shots import Shots


def shots_from_scan(
    cloud: Cloud,
    scanner_position_m: np.ndarray,
    frame: ScanFrame,
    *,
    scan: int = 1,
    lowest_miss_zenith_deg: float = 100.0,
    max_tilt_correction_deg: float = 0.2,
    source: str | Path = "scan_frame",
) -> tuple[Shots, dict]:
    """Group the points of one scan into shots, and rebuild the shots that met nothing.

    Parameters
    ----------
    cloud : Cloud
        The points of one scan; `ReturnNumber` and `NumberOfReturns` group them, if there.
    scanner_position_m : (3,) array_like
        Local frame [m].
    frame : ScanFrame
        As the scanner's settings tell it. Steps, tilt, origin and the bend of lines are refined.
    scan : int
        Number of the scan position.
    lowest_miss_zenith_deg : float
        Directions without a return that point further down are left out, neither hit nor free:
        the ground is there, so something nearer than the least range stood in the way (tripod,
        operator).
    max_tilt_correction_deg : float
        A larger correction of the tilt means that `frame.tilt_deg` is wrong in sign or order.
    source : str or Path
        The file or key to name in errors.

    Returns
    -------
    shots : Shots
        By line and row. Shots with returns point at their farthest one, misses along the lattice.
    facts : dict
        Counts, share of misses, residuals against the lattice, tilt that was corrected.

    Raises
    ------
    InputError
        The points do not fit the frame: wrong numbers of directions, angles, tilt or position.

    Notes
    -----
    Returns beyond a clipping of the cloud count as none: right for voxels within the clipping.
    """
    _enough(cloud, source)
    position = np.asarray(scanner_position_m, float)
    zenith, azimuth, range_m = lattice.spherical((cloud.xyz_m - position) @ frame.rotation)
    lines = lattice.fit_lines(zenith, azimuth, range_m, frame)
    _check_fit(source, "azimuth", lines.residual, np.degrees(lines.step))
    _check_tilt(source, frame, lines, max_tilt_correction_deg)
    rows = lattice.fit_rows(zenith, range_m, lines, frame.zenith_step)
    _check_fit(source, "zenith", rows.residual, np.degrees(rows.step))

    shot, shot_line, shot_row = _group(cloud, lines, rows, range_m)
    low, high = _row_window(frame, rows, shot_line, shot_row)
    miss_line, miss_row = _empty_cells(lines.n, low, high, shot_line, shot_row)
    miss = _directions(lines, rows, miss_line, miss_row) @ frame.rotation.T
    kept = np.degrees(np.arccos(np.clip(miss[:, 2], -1, 1))) <= lowest_miss_zenith_deg
    order = np.lexsort(
        [
            np.concatenate([shot_row, miss_row[kept]]),
            np.concatenate([shot_line, miss_line[kept]]),
        ]
    )
    shots = _assemble(cloud, position, shot, range_m, len(shot_line), miss[kept], order, scan)
    facts = _counts(shots, cloud) | {
        "n_blocked": int((~kept).sum()),
        "n_lines": lines.n,
        "n_rows": high - low + 1,
        "azimuth_step_deg": np.degrees(lines.step / (1 - lines.coefficients[6])),
        "zenith_step_deg": np.degrees(rows.step),
        "azimuth_residual_deg": _percentiles(lines.residual * np.degrees(lines.step)),
        "zenith_residual_deg": _percentiles(rows.residual * np.degrees(rows.step)),
        "tilt_correction_deg": float(np.degrees(np.hypot(*lines.coefficients[4:6]))),
        "collimation_deg": float(np.degrees(lines.coefficients[1])),
        "trunnion_deg": float(np.degrees(lines.coefficients[2])),
    }
    return shots, facts


def _enough(cloud: Cloud, source: str | Path) -> None:
    if len(cloud) < 1000:
        raise EmptyCloudError(
            source,
            f"{len(cloud)} points",
            "at least 1000, to find the frame of directions",
            "Give the whole scan.",
        )


def _check_fit(source: str | Path, what: str, residual: np.ndarray, step_deg: float) -> None:
    median = float(np.median(np.abs(residual)))
    if median > lattice.WORST_MEDIAN:
        raise InputError(
            source,
            f"points that lie {median:.2f} steps (median) off the frame in {what}; 0.25 is chance",
            f"directions on a regular frame of {step_deg:.4f}° in {what}",
            "Check the number of directions, their angles, the tilt (roll, pitch, yaw) and the "
            "scanner's position; the cloud must be one scan, not thinned or smoothed.",
        )


def _check_tilt(source: str | Path, frame: ScanFrame, lines, most_deg: float) -> None:
    correction = float(np.degrees(np.hypot(*lines.coefficients[4:6])))
    if correction > most_deg:
        raise InputError(
            source,
            f"lines of shots tilted by {correction:.2f}° against the stated tilt {frame.tilt_deg}",
            f"at most {most_deg}°",
            "Check signs and order of the tilt: roll about x, then pitch about y, then yaw about "
            "z, each counter-clockwise, from the scanner's frame to the cloud's.",
        )


def _group(cloud: Cloud, lines, rows, range_m: np.ndarray):
    """Shot of each point, and line and row of each shot."""
    n = len(cloud)
    one = np.ones(n, np.int64)
    number = cloud.attributes.get("ReturnNumber", one).astype(np.int64)
    count = cloud.attributes.get("NumberOfReturns", one).astype(np.int64)
    order = np.lexsort([rows.position, count, lines.line])
    shot = np.empty(n, np.int64)
    shot[order] = lattice.group_returns(
        lines.line[order], count[order], number[order], rows.position[order], 0.6
    )
    # The farthest return tells the direction best: its rounding counts least.
    farthest = np.empty(shot.max() + 1, np.int64)
    by_range = np.argsort(range_m, kind="stable")
    farthest[shot[by_range]] = by_range
    line, place = lines.line[farthest], rows.position[farthest]
    weight = 1 / (0.05**2 + (lattice.COORDINATE_NOISE_M / (range_m[farthest] * rows.step)) ** 2)
    order = np.lexsort([place, line])
    row = np.empty(len(line), np.int64)
    row[order] = lattice.distinct_rows(line[order], place[order], weight[order])
    return shot, line, row


def _row_window(frame: ScanFrame, rows, shot_line, shot_row) -> tuple[int, int]:
    """First and last row: the frame's, or further where several lines have shots."""
    nominal = [rows.position_of(np.radians(angle)) for angle in sorted(frame.zenith_deg)]
    low, high = int(np.rint(nominal[0])), int(np.rint(nominal[1]))
    base = min(low, int(shot_row.min()))
    lines_in_row = np.bincount(shot_row - base)
    used = np.flatnonzero(lines_in_row >= max(3, 0.02 * len(np.unique(shot_line)))) + base
    return (min(low, int(used[0])), max(high, int(used[-1]))) if len(used) else (low, high)


def _empty_cells(n_lines: int, low: int, high: int, line, row) -> tuple[np.ndarray, np.ndarray]:
    taken = np.zeros((n_lines, high - low + 1), bool)
    inside = (row >= low) & (row <= high)
    taken[line[inside], row[inside] - low] = True
    empty_line, empty_row = np.nonzero(~taken)
    return empty_line, empty_row + low


def _directions(lines, rows, line: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Unit vectors of lattice cells in the scanner's frame, (n, 3)."""
    zenith = rows.zenith(line, row)
    azimuth = np.empty(len(line))
    for at in range(0, len(line), 200_000):
        part = slice(at, at + 200_000)
        azimuth[part] = lines.azimuth(line[part], zenith[part])
    sine = np.sin(zenith)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(zenith)], axis=1)


def _assemble(
    cloud: Cloud, position, shot, range_m, n_shots: int, miss: np.ndarray, order, scan: int
) -> Shots:
    """Shots with returns and misses together, in `order`; returns near to far."""
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    by_shot = np.lexsort([range_m, place[shot]])
    count = np.zeros(len(order), np.int64)
    count[place[:n_shots]] = np.bincount(shot, minlength=n_shots)
    first = np.concatenate([[0], np.cumsum(count)])
    direction = np.empty((len(order), 3))
    direction[place[n_shots:]] = miss
    farthest = by_shot[first[1:][count > 0] - 1]
    direction[count > 0] = (cloud.xyz_m[farthest] - position) / range_m[farthest, None]
    unknown = np.full(len(cloud), np.nan, np.float32)
    return Shots(
        np.broadcast_to(position, (len(order), 3)).copy(),
        direction,
        np.full(len(order), scan, np.uint16),
        first,
        range_m[by_shot],
        cloud.attributes.get("Reflectance", unknown)[by_shot].astype(np.float32),
        cloud.attributes.get("Deviation", unknown)[by_shot].astype(np.float32),
        np.asarray(cloud.origin_m, float),
    )


def _counts(shots: Shots, cloud: Cloud) -> dict:
    n = shots.n_returns
    misses = int((n == 0).sum())
    facts = {
        "n_shots": len(shots),
        "n_misses": misses,
        "share_of_misses": misses / len(shots),
        "n_returns": int(n.sum()),
    }
    if "NumberOfReturns" in cloud.attributes:
        # Each return stands for 1/count of its shot; what is missing of the sum was clipped away.
        whole = float((1.0 / cloud.attributes["NumberOfReturns"]).sum())
        facts["share_of_shots_with_clipped_returns"] = 1.0 - whole / int((n > 0).sum())
    return facts


def _percentiles(values: np.ndarray) -> dict[str, float]:
    absolute = np.percentile(np.abs(values), [50, 95, 99])
    return dict(zip(("median", "p95", "p99"), absolute.tolist(), strict=True))
