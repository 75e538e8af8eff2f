"""What shots did and what a reconstruction would have them do: scores by part of the crown."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from dapple.formats.shots import Shots
from dapple.virtual.rescan import Crown
from dapple.virtual.scanner_window import through_box

ZONES = ("core", "middle", "edge")
"""Thirds of the crown's radius, by how near a shot comes to its axis."""
PATCH_DEG = 1.0
"""Edge of the patches in which shares of shots that pass are compared."""
LEAST_SHOTS = 20
"""Fewer shots of a patch say nothing of a share."""


def compared(
    predicted: Iterable[tuple[Shots, np.ndarray]], crown: Crown, max_deviation: float
) -> pd.DataFrame:
    """What shots through the crown's box did, and what they should have done.

    Parameters
    ----------
    predicted : iterable of (Shots, (n,) float64)
        As from `first_ranges`.
    crown : Crown
    max_deviation : float
        Returns at or above are mixed of several targets, and their range is that of none.

    Returns
    -------
    pandas.DataFrame
        One row a shot that meets the box and has no return before it: `scan`; `seen_m` and
        `predicted_m`, the range of the first return in the box, infinite where the shot passes;
        `is_mixed`; `height`, from 0 to 1 in the box, and `away`, in radii of the crown, where it
        comes nearest to the crown's axis; `azimuth_deg` and `zenith_deg` of the shot.
    """
    parts = []
    for shots, range_m in predicted:
        enter_m, leave_m = through_box(shots.origin_m, shots.direction, crown.low_m, crown.high_m)
        shot = shots.shot_of_return
        inside = (shots.range_m >= enter_m[shot]) & (shots.range_m <= leave_m[shot])
        first = np.full(len(shots), len(shots.range_m))
        np.minimum.at(first, shot[inside], np.flatnonzero(inside))
        has_return = first < len(shots.range_m)
        seen_m = np.append(shots.range_m, np.inf)[first]
        deviation = np.append(shots.deviation, 0.0)[first]
        range_m = np.where((range_m >= enter_m) & (range_m <= leave_m), range_m, np.inf)
        before = np.zeros(len(shots), bool)
        before[shot[shots.range_m < enter_m[shot]]] = True
        height, away = _place(shots, crown, enter_m, leave_m)
        x, y, z = shots.direction.T
        rows = pd.DataFrame(
            {
                "scan": shots.scan,
                "seen_m": seen_m,
                "predicted_m": range_m,
                "is_mixed": has_return & (deviation >= max_deviation),
                "height": height,
                "away": away,
                "azimuth_deg": np.degrees(np.arctan2(x, y)) % 360,
                "zenith_deg": np.degrees(np.arccos(np.clip(z, -1, 1))),
            }
        )
        parts.append(rows[(leave_m > enter_m) & ~before])
    return pd.concat(parts, ignore_index=True)


def _place(
    shots: Shots, crown: Crown, enter_m: np.ndarray, leave_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Height and distance from the axis where shots come nearest to it, within the box."""
    plan = shots.direction[:, :2]
    across = np.maximum((plan**2).sum(axis=1), 1e-12)
    to_axis = ((crown.axis_m - shots.origin_m[:, :2]) * plan).sum(axis=1) / across
    t = np.clip(to_axis, enter_m, np.maximum(leave_m, enter_m))
    at = shots.origin_m + t[:, None] * shots.direction
    height = (at[:, 2] - crown.low_m[2]) / (crown.high_m[2] - crown.low_m[2])
    return height, np.hypot(*(at[:, :2] - crown.axis_m).T) / crown.radius_m


def scored(rows: pd.DataFrame, tolerance_m: float) -> dict[str, float]:
    """How well a reconstruction predicts shots.

    Parameters
    ----------
    rows : pandas.DataFrame
        Of `compared`.
    tolerance_m : float
        A range this near to the measured one is right [m].

    Returns
    -------
    dict of str to float
        `shots`; `right_share`: both pass, or both end within the tolerance (a mixed return counts
        where both end); `hit_or_pass_share`: both pass or both end; `passed_share` and
        `predicted_passed_share`; `range_bias_m`: median of predicted less measured range where
        both end; `range_near_share`: of those, within the tolerance; `gap_rmse`: root mean square
        error of the share that passes over patches of a degree, without what chance alone makes
        of so few shots.
    """
    seen, predicted = rows["seen_m"].to_numpy(), rows["predicted_m"].to_numpy()
    passed, should_pass = np.isinf(seen), np.isinf(predicted)
    both_end = ~passed & ~should_pass
    apart_m = np.where(both_end, predicted, 0) - np.where(both_end, seen, 0)
    near = both_end & (np.abs(apart_m) <= tolerance_m)
    clear = both_end & ~rows["is_mixed"].to_numpy()
    right = (passed & should_pass) | near | (both_end & ~clear)
    return {
        "shots": len(rows),
        "right_share": _mean(right),
        "hit_or_pass_share": _mean(passed == should_pass),
        "passed_share": _mean(passed),
        "predicted_passed_share": _mean(should_pass),
        "range_bias_m": float(np.median(apart_m[clear])) if clear.any() else np.nan,
        "range_near_share": _mean(near[clear]),
        "gap_rmse": gap_rmse(rows),
    }


def by_part(rows: pd.DataFrame, layers: int, tolerance_m: float) -> pd.DataFrame:
    """Scores of all shots, and by height layer and zone.

    Returns
    -------
    pandas.DataFrame
        `layer` (from 1 at the ground; `all`), `zone` (`ZONES`; `all`) and what `scored` tells.
    """
    layer = np.clip((rows["height"] * layers).astype(int), 0, layers - 1) + 1
    zone = np.array(ZONES)[np.clip((rows["away"] * 3).astype(int), 0, 2)]
    found = [{"layer": "all", "zone": "all"} | scored(rows, tolerance_m)]
    for number in range(1, layers + 1):
        own = rows[layer == number]
        found.append({"layer": str(number), "zone": "all"} | scored(own, tolerance_m))
    for name in ZONES:
        found.append({"layer": "all", "zone": name} | scored(rows[zone == name], tolerance_m))
    return pd.DataFrame(found)


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def patches_of(zenith_deg: np.ndarray, azimuth_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of the patch that each direction lies in, (n,) int64."""
    row = (zenith_deg / PATCH_DEG).astype(np.int64)
    column = azimuth_deg * np.sin(np.radians(zenith_deg)) / PATCH_DEG
    return row, column.astype(np.int64)


def gap_rmse(rows: pd.DataFrame) -> float:
    """Error of the share of shots that pass, as in `scored`; NaN where all patches are too small.

    Parameters
    ----------
    rows : pandas.DataFrame
        Of `compared`.
    """
    row, column = patches_of(rows["zenith_deg"].to_numpy(), rows["azimuth_deg"].to_numpy())
    patches = (
        pd.DataFrame(
            {
                "scan": rows["scan"],
                "row": row,
                "column": column,
                "passed": np.isinf(rows["seen_m"]).astype(float),
                "predicted": np.isinf(rows["predicted_m"]).astype(float),
            }
        )
        .groupby(["scan", "row", "column"])[["passed", "predicted"]]
        .agg(["mean", "size"])
    )
    n = patches["passed"]["size"].to_numpy(float)
    enough = n >= LEAST_SHOTS
    if not enough.any():
        return float("nan")
    error = (patches["predicted"]["mean"] - patches["passed"]["mean"]).to_numpy()[enough]
    return float(np.sqrt(np.average(error**2, weights=n[enough])))
