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
from dapple.stats.correlation import pearson

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
        `level, east_m, north_m, clock_offset_s, r`: all that was tried.
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
        words = f"times up to {last:%Y-%m-%d %H:%M %Z}", f"times from {first:%Y-%m-%d %H:%M %Z}"
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
    shift_resolution_m: float = 0.03,
    clock_range_s: float = 300.0,
    clock_step_s: float = 60.0,
    clock_resolution_s: float = 10.0,
    n_starts: int = 3,
    max_shifts_per_call: int = 32,
) -> Registration:
    """Search shift and clock offset, coarse to fine, for the highest r on the fitting records.

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
    shift_step_m, clock_step_s : float
        First spacing of the grid [m], [s]; halved from level to level. The first spacing has to
        resolve the shadows (a branch or a gap), or their peak falls between two candidates.
    shift_resolution_m, clock_resolution_s : float
        Spacing at which the search stops [m], [s].
    n_starts : int
        Number of best, mutually distant candidates that are refined from level to level.
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
    grid = np.array([shift_step_m, shift_step_m, clock_step_s])
    finest = np.array([shift_resolution_m, shift_resolution_m, clock_resolution_s])
    centre = np.array([*centre_m, 0.0])
    half = np.array([shift_range_m, shift_range_m, clock_range_s])
    scores: dict[tuple[float, ...], tuple[int, float]] = {}
    candidates = _grid(centre, half, grid)
    for level in range(32):
        new = [c for c in candidates if c not in scores]
        r = _scores(new, measured, usable, time_s, simulate, fine_time_s, max_shifts_per_call)
        scores |= {candidate: (level, value) for candidate, value in zip(new, r, strict=True)}
        best = _best(scores, n_starts, grid)
        if np.all((grid <= finest) | (half == 0)):
            break
        # The finer grid reaches one coarse step around every start, within the range.
        reach, grid = grid, np.where(grid > finest, grid / 2, grid)
        candidates = _around(best, reach, grid, centre, half)
    return _registration(scores, best[0], centre, half, int(usable.sum()))


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
    """Grid values that contain the centre and stay within the range."""
    count = int(np.floor(half / step + 1e-9)) if half > 0 else 0
    return centre + step * np.arange(-count, count + 1)


def _grid(centre, half, step) -> list[tuple[float, ...]]:
    axes = [_axis(*three) for three in zip(centre, half, step, strict=True)]
    mesh = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return [tuple(row) for row in mesh.round(9).tolist()]


def _around(best, reach, step, centre, half) -> list[tuple[float, ...]]:
    """Finer grids around each start, without repeats, in a fixed order."""
    found: dict[tuple[float, ...], None] = {}
    for start in best:
        around = np.array(_grid(np.array(start), np.where(half > 0, reach, 0.0), step))
        inside = np.all(np.abs(around - centre) <= half + 1e-9, axis=1)
        found |= dict.fromkeys(tuple(row) for row in around[inside].tolist())
    return list(found)


def _best(scores, n_starts: int, step: np.ndarray) -> list[tuple[float, ...]]:
    """Best candidates that are no direct neighbours of a better one."""
    defined = [(r, candidate) for candidate, (_, r) in scores.items() if np.isfinite(r)]
    if not defined:
        raise InputError(
            "registration",
            "no candidate with a defined r",
            "fitting records and simulated light that vary",
            "Fit on a period with sun flecks, or give more sensors.",
        )
    chosen: list[tuple[float, ...]] = []
    for _, candidate in sorted(defined, key=lambda pair: -pair[0]):
        offsets = np.abs(np.array(chosen).reshape(-1, 3) - candidate)
        if not np.any(np.all(offsets <= step * 1.5, axis=1)):
            chosen.append(candidate)
        if len(chosen) == n_starts:
            break
    return chosen


def _scores(candidates, measured, usable, time_s, simulate, fine_time_s, max_shifts) -> np.ndarray:
    """r of every candidate; candidates of one shift share one simulation."""
    rows, columns = np.nonzero(usable)
    target = measured[rows, columns]
    by_shift: dict[tuple[float, float], list[int]] = {}
    for index, (east, north, _) in enumerate(candidates):
        by_shift.setdefault((east, north), []).append(index)
    r = np.full(len(candidates), np.nan)
    shifts = list(by_shift)
    for start in range(0, len(shifts), max_shifts):
        some = shifts[start : start + max_shifts]
        fine = np.asarray(simulate(np.array(some)), float)
        _check_shape(fine, (len(some), len(measured), len(fine_time_s)))
        for light, shift in zip(fine, some, strict=True):
            for index in by_shift[shift]:
                true_time_s = time_s[columns] - candidates[index][2]
                r[index] = pearson(target, _interpolate(light, rows, true_time_s, fine_time_s))
    return r


def _interpolate(light, rows, at_s, fine_time_s) -> np.ndarray:
    """Linear interpolation in time of each record's own sensor."""
    right = np.clip(np.searchsorted(fine_time_s, at_s), 1, len(fine_time_s) - 1)
    left = right - 1
    weight = (at_s - fine_time_s[left]) / (fine_time_s[right] - fine_time_s[left])
    return light[rows, left] * (1 - weight) + light[rows, right] * weight


def _check_shape(fine: np.ndarray, expected: tuple[int, ...]) -> None:
    if fine.shape != expected:
        raise ValueError(f"simulate() returned shape {fine.shape}, not {expected}")


def _registration(scores, best, centre, half, n_fit) -> Registration:
    names = ("east_m", "north_m", "clock_offset_s")
    distance = np.abs(np.array(best) - centre)
    edge = tuple(
        name for name, d, h in zip(names, distance, half, strict=True) if h > 0 and d >= h - 1e-9
    )
    table = pd.DataFrame(
        [(level, *candidate, r) for candidate, (level, r) in scores.items()],
        columns=["level", *names, "r"],
    )
    return Registration(*best, scores[best][1], n_fit, edge, table)
