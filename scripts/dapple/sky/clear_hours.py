"""The level of clear hours: what tells the unit of a radiation table, even in a dark month."""

from dataclasses import dataclass

import numpy as np

SUN_DEG = 5.0
"""Lower than this the clear-sky model says too little."""
BLOCK_MIN = 5.0
"""Rows that are closer are averaged: sensors are noisy within seconds."""
SPELL_ROWS, SPELL_MIN = 3, 90.0
"""A spell is so many rows, and so many minutes, at least."""
STEADY = 0.02
"""A spell is steady where the ratio to a clear sky varies by this share (standard deviation)."""
ALIKE = 0.1
"""Steady spells are of one level where they lie so close together, as a share of it."""
DAYS = 3
"""A level is known where steady spells of so many days have it."""
LEAST_SHARE = 0.2
"""So many of the steady spells have the level of clear hours, or clouds are as steady by chance."""
ABOVE, MOST_ABOVE = 1.15, 0.03
"""Few rows are above the level of clear hours by more than edges of clouds reflect."""


@dataclass(frozen=True)
class ClearLevel:
    """The highest level at which many hours run along with a clear sky.

    Attributes
    ----------
    ratio : float
        Radiation over that of the clear-sky model: 1 in the right unit, within haze.
    days : int
        Days with such hours.
    share : float
        Of all steady spells.
    """

    ratio: float
    days: int
    share: float


def level(
    ratio: np.ndarray, elevation_deg: np.ndarray, day: np.ndarray, step_min: float
) -> ClearLevel | None:
    """The level of clear hours, or None where no hour is told from clouds.

    Clouds differ from hour to hour and from day to day, a clear sky returns to the same level. So
    the level is that of the brightest steady spells that agree on several days.

    Parameters
    ----------
    ratio : (n,) float
        Radiation over that of the clear-sky model, by ascending time.
    elevation_deg : (n,) float
        Of the sun.
    day : (n,) int
        Solar day of each row.
    step_min : float
        Step between rows [min].
    """
    block = max(1, round(BLOCK_MIN / step_min)) if step_min > 0 else 1
    if block > 1:
        whole = len(ratio) // block * block
        ratio, elevation_deg = (
            one[:whole].reshape(-1, block).mean(axis=1) for one in (ratio, elevation_deg)
        )
        day, step_min = day[:whole:block], block * step_min
    is_up = (elevation_deg > SUN_DEG) & np.isfinite(ratio)
    if not is_up.any() or not np.isfinite(step_min):
        return None
    days, means = steady_spells(np.where(is_up, ratio, np.nan), day, step_min)
    least_days = min(DAYS, len(np.unique(day[is_up])))
    for highest in np.sort(means)[::-1]:
        alike = (means <= highest) & (means >= (1.0 - ALIKE) * highest)
        found = ClearLevel(
            float(np.median(means[alike])), len(np.unique(days[alike])), float(alike.mean())
        )
        above = float((ratio[is_up] > ABOVE * found.ratio).mean())
        if above > MOST_ABOVE:
            return None  # spells further down have still more above them
        if found.days >= least_days and found.share >= LEAST_SHARE:
            return found
    return None


def steady_spells(
    ratio: np.ndarray, day: np.ndarray, step_min: float
) -> tuple[np.ndarray, np.ndarray]:
    """Day and mean ratio (s,) of spells that run along with a clear sky and do not overlap.

    NaN where the sun is too low.
    """
    rows = max(SPELL_ROWS, int(np.ceil(SPELL_MIN / max(step_min, 0.1))))
    if len(ratio) < rows:
        return np.zeros(0, int), np.zeros(0)
    windows = np.lib.stride_tricks.sliding_window_view(ratio, rows)
    mean, spread = windows.mean(axis=1), windows.std(axis=1)
    is_steady = (mean > 0) & (spread < STEADY * mean) & (day[: len(mean)] == day[rows - 1 :])
    starts: list[int] = []
    free = 0
    for start in np.flatnonzero(is_steady).tolist():
        if start >= free:
            starts.append(start)
            free = start + rows
    return day[starts], mean[starts]
