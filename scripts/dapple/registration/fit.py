"""Co-registration: where the scan's origin lies, and how far the loggers' clock is off.

Shadow patterns move with the sun, so that a shift of the structure and an offset of the clock can
stand in for each other over a short time. Both are therefore searched together, on one named part
of the records, and judged on the rest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.stats.measures import pearson

CANDIDATES = ["level", "east_m", "north_m", "clock_offset_s", "r"]

Simulate = Callable[[np.ndarray], np.ndarray]
"""Shifts (k, 2) east and north [m] to PAR (k, sensor, fine time)."""


@dataclass(frozen=True)
class Split:
    """Which records fit and which report; the descriptions go into the output as they are.

    Attributes
    ----------
    fitting, reporting : (sensor, time) bool
        Disjoint, together everything.
    fitting_part, reporting_part : str
        The two parts in words, with the sensors or the times in them.
    """

    fitting: np.ndarray
    reporting: np.ndarray
    fitting_part: str
    reporting_part: str


@dataclass(frozen=True)
class Registration:
    """The best shift and clock offset.

    Attributes
    ----------
    east_m, north_m : float
        Shift that was passed to `simulate` [m].
    clock_offset_s : float
        What the loggers' clock shows minus the true time [s].
    r_fit : float
        Pearson's r on the fitting records.
    n_fit : int
        Number of fitting records.
    at_edge : tuple of str
        Which of `east_m`, `north_m`, `clock_offset_s` ended at the limit of its range: the truth
        may lie beyond it.
    candidates : DataFrame
        `level, east_m, north_m, clock_offset_s, r`: every shift that was tried, at its best
        clock offset.
    """

    east_m: float
    north_m: float
    clock_offset_s: float
    r_fit: float
    n_fit: int
    at_edge: tuple[str, ...]
    candidates: pd.DataFrame


def split(
    sensors: Sequence[str],
    times: pd.DatetimeIndex,
    *,
    by: str = "sensor",
    share: float = 1 / 3,
    seed: int = 0,
) -> Split:
    """Name the records that fit and those that report.

    Parameters
    ----------
    sensors : sequence of str
        Sensor labels.
    times : DatetimeIndex
        UTC, ascending.
    by : {"sensor", "time"}
        "sensor" draws sensors by `seed`; "time" takes the first part of the period. Single
        records are not drawn: the neighbour of a fitting record is no independent witness.
    share : float
        Share of the sensors or times that fits, above 0 and below 1.
    seed : int
        Seed of the draw of sensors.

    Raises
    ------
    InputError
        `by` is unknown, the times have no time zone, or one of the parts would be empty.
    """
    if by not in ("sensor", "time"):
        raise InputError("registration.by", by, "sensor or time", "Choose one of the two.")
    if times.tz is None:
        raise InputError("times", "no time zone", "UTC", "Localise the times: tz_localize('UTC').")
    n = len(sensors) if by == "sensor" else len(times)
    n_fit = round(share * n)
    if not 0 < n_fit < n:
        raise InputError(
            "registration.share",
            f"{share} of {n} {by}s, which leaves one part empty",
            "a share that gives both parts at least one",
            "Choose a share nearer to 0.5, or turn the registration off.",
        )
    chosen = np.zeros(n, bool)
    if by == "time":
        chosen[:n_fit] = True
        last, first = times[n_fit - 1], times[n_fit]
        words: tuple[str, ...] = (
            f"times up to {last:%Y-%m-%d %H:%M %Z}",
            f"times from {first:%Y-%m-%d %H:%M %Z}",
        )
        fitting = np.broadcast_to(chosen, (len(sensors), n)).copy()
    else:
        chosen[np.random.default_rng(seed).permutation(n)[:n_fit]] = True
        words = tuple(
            f"{mask.sum()} of {n} sensors: {', '.join(np.asarray(sensors)[mask])}"
            for mask in (chosen, ~chosen)
        )
        fitting = np.broadcast_to(chosen[:, None], (n, len(times))).copy()
    return Split(fitting, ~fitting, *words)


def register(
    measured: np.ndarray,
    time_s: np.ndarray,
    simulate: Simulate,
    fine_time_s: np.ndarray,
    *,
    fitting: np.ndarray | None = None,
    centre_m: tuple[float, float] = (0.0, 0.0),
    shift_range_m: float = 1.0,
    shift_step_m: float = 0.25,
    shift_resolution_m: float = 0.01,
    clock_range_s: float = 300.0,
    clock_step_s: float = 10.0,
    n_starts: int = 3,
    max_shifts_per_call: int = 32,
) -> Registration:
    """Search shift and clock offset for the highest r on the fitting records.

    The clock offset needs no new simulation, so every shift is scored at its best offset: that
    leaves a search in the plane. It begins with a grid, climbs from the best grid points to their
    peaks, and repeats the climb with half the step until the resolution is reached.

    Parameters
    ----------
    measured : (sensor, time) array
        PAR as recorded; NaN where there is no record.
    time_s : (time,) array
        What the loggers' clock showed [s], from any epoch.
    simulate : callable
        Takes shifts (k, 2), returns PAR (k, sensor, fine time). What is shifted (structure or
        sensors) is its own affair.
    fine_time_s : (fine time,) array
        True times of the simulation [s], same epoch, ascending. They have to cover the records
        widened by `clock_range_s` on both sides, and be dense enough to interpolate between.
    fitting : (sensor, time) bool array, optional
        Records that count; all where it is None.
    centre_m : (float, float)
        Centre of the search, east and north [m].
    shift_range_m, clock_range_s : float
        Half width of the search [m], [s]; 0 keeps that quantity at its centre.
    shift_step_m : float
        Spacing of the first grid [m]. It has to resolve the shadows (a branch, a gap), or a peak
        falls between two grid points.
    shift_resolution_m : float
        The climb ends when its step is no longer than this [m].
    clock_step_s : float
        Spacing of the clock offsets [s].
    n_starts : int
        Number of best, mutually distant grid points from which to climb.
    max_shifts_per_call : int
        Largest k, which bounds the memory of `simulate`.

    Returns
    -------
    Registration

    Raises
    ------
    InputError
        Too few fitting records, a fine time axis that is too short, or no candidate with a
        defined r.
    """
    usable = np.isfinite(measured) & (True if fitting is None else fitting)
    _check(usable, time_s, fine_time_s, clock_range_s)
    offsets_s = _axis(0.0, clock_range_s, clock_step_s)
    scores = pd.DataFrame(columns=CANDIDATES, dtype=float)

    def score(shifts: np.ndarray, level: int) -> None:
        """Add the shifts that are new to the table, a bounded number at a time."""
        nonlocal scores
        known = set(map(tuple, scores[["east_m", "north_m"]].to_numpy()))
        new = np.array([shift for shift in shifts.tolist() if tuple(shift) not in known])
        for start in range(0, len(new), max_shifts_per_call):
            some = new[start : start + max_shifts_per_call]
            light = np.asarray(simulate(some), float)
            _check_shape(light, (len(some), len(measured), len(fine_time_s)))
            found = [
                _best_clock(one, measured, usable, time_s, fine_time_s, offsets_s) for one in light
            ]
            rows = np.column_stack([np.full(len(some), level), some, found])
            scores = pd.DataFrame(np.vstack([scores, rows]), columns=CANDIDATES)

    centre = np.array(centre_m)
    score(_square(centre, shift_range_m, shift_step_m), 0)
    step, level = shift_step_m, 0
    while shift_range_m > 0 and step > shift_resolution_m:
        step, level = step / 2, level + 1
        for _ in range(100):
            starts = _peaks(scores, n_starts, shift_step_m)
            around = np.concatenate([_square(start, step, step) for start in starts])
            inside = np.abs(around - centre).max(axis=1) <= shift_range_m + 1e-9
            score(np.unique(around[inside], axis=0), level)
            if np.array_equal(starts, _peaks(scores, n_starts, shift_step_m)):
                break
    return _registration(scores, centre, shift_range_m, clock_range_s, int(usable.sum()))


def at_times(
    light: np.ndarray, time_s: np.ndarray, found: Registration, fine_time_s: np.ndarray
) -> np.ndarray:
    """Simulated values (sensor, fine time) at the times that loggers showed, (sensor, time)."""
    true_s = time_s - found.clock_offset_s
    return np.stack([np.interp(true_s, fine_time_s, one) for one in light])


def _check(usable, time_s, fine_time_s, clock_range_s) -> None:
    if usable.sum() < 3:
        raise InputError(
            "registration",
            f"{int(usable.sum())} fitting records",
            "at least three",
            "Give the fitting part more sensors or times.",
        )
    used = time_s[usable.any(axis=0)]
    first, last = used.min() - clock_range_s, used.max() + clock_range_s
    if fine_time_s[0] > first or fine_time_s[-1] < last:
        raise InputError(
            "registration",
            f"simulated times from {fine_time_s[0]:g} to {fine_time_s[-1]:g} s",
            f"times that cover {first:g} to {last:g} s",
            "Simulate the records' period widened by clock_range_s on both sides.",
        )


def _axis(centre: float, half: float, step: float) -> np.ndarray:
    """Values that contain the centre and stay within the range."""
    count = int(np.floor(half / step + 1e-9)) if half > 0 else 0
    return centre + step * np.arange(-count, count + 1)


def _square(centre: np.ndarray, half: float, step: float) -> np.ndarray:
    """(k, 2) grid of shifts; rounded, so that a shift met twice is recognised."""
    axes = np.meshgrid(*(_axis(value, half, step) for value in centre), indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, 2).round(6)


def _peaks(scores: pd.DataFrame, n_starts: int, distance_m: float) -> np.ndarray:
    """(k, 2) best shifts that are farther than `distance_m` from every better one."""
    ranked = scores.dropna(subset="r").sort_values("r", ascending=False, kind="stable")
    if ranked.empty:
        raise InputError(
            "registration",
            "no candidate with a defined r",
            "fitting records and simulated light that vary",
            "Fit on a period with sun flecks, or give more sensors.",
        )
    chosen = np.empty((0, 2))
    for shift in ranked[["east_m", "north_m"]].to_numpy():
        if not np.any(np.abs(chosen - shift).max(axis=1, initial=0) <= distance_m):
            chosen = np.vstack([chosen, shift])
        if len(chosen) == n_starts:
            break
    return chosen


def _best_clock(light, measured, usable, time_s, fine_time_s, offsets_s) -> tuple[float, float]:
    """Clock offset with the highest r, and that r, for the light (sensor, fine time) of a shift."""
    rows, columns = np.nonzero(usable)
    target = measured[rows, columns]
    r = [
        pearson(target, _interpolate(light, rows, time_s[columns] - offset_s, fine_time_s))
        for offset_s in offsets_s
    ]
    # Among equals the offset nearest to zero: a clock is right until the records say otherwise.
    best = np.lexsort([np.abs(offsets_s), -np.nan_to_num(r, nan=-2.0)])[0]
    return offsets_s[best], r[best]


def _interpolate(light, rows, at_s, fine_time_s) -> np.ndarray:
    """Linear interpolation in time of each record's own sensor."""
    right = np.clip(np.searchsorted(fine_time_s, at_s), 1, len(fine_time_s) - 1)
    left = right - 1
    weight = (at_s - fine_time_s[left]) / (fine_time_s[right] - fine_time_s[left])
    return light[rows, left] * (1 - weight) + light[rows, right] * weight


def _check_shape(fine: np.ndarray, expected: tuple[int, ...]) -> None:
    if fine.shape != expected:
        raise ValueError(f"simulate() returned shape {fine.shape}, not {expected}")


def _registration(scores, centre, shift_range_m, clock_range_s, n_fit) -> Registration:
    best = scores.loc[scores["r"].idxmax()]
    limits = {
        "east_m": (best["east_m"] - centre[0], shift_range_m),
        "north_m": (best["north_m"] - centre[1], shift_range_m),
        "clock_offset_s": (best["clock_offset_s"], clock_range_s),
    }
    at_edge = tuple(
        name for name, (value, half) in limits.items() if half > 0 and abs(value) >= half - 1e-6
    )
    east_m, north_m, offset_s = (float(best[name]) for name in limits)
    tried = scores.astype({"level": int})
    return Registration(east_m, north_m, offset_s, float(best["r"]), n_fit, at_edge, tried)
