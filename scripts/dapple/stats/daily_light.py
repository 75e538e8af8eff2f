"""Daily light integrals, and the flecks of sun that make them up."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

MIN_BEAM = 50.0
"""Level PAR of an open beam below which nobody speaks of sunflecks [µmol m⁻² s⁻¹]."""
SEEN = 0.5
"""Share of the sun's disc above which a sensor is in a sunfleck."""


@dataclass(frozen=True)
class Sunflecks:
    """Sunflecks of n sensors.

    Attributes
    ----------
    time_share, light_share : (n,) array
        Share of the sunny time, and of the light integral, in flecks.
    per_day : (n,) array
        How many begin a day.
    median_min : (n,) array
        Median duration [min]; NaN where there is none.
    """

    time_share: np.ndarray
    light_share: np.ndarray
    per_day: np.ndarray
    median_min: np.ndarray


def integral_mol_m2(par: np.ndarray, times: pd.DatetimeIndex) -> np.ndarray:
    """(n,) light integral a day [mol m⁻² d⁻¹], the mean over days of which anything is known.

    Parameters
    ----------
    par : (n, t) array
        [µmol m⁻² s⁻¹]; NaN where unknown, which is left out.
    times : (t,) DatetimeIndex
        On the local clock, by which days are told.
    """
    days = times.normalize()
    found = []
    for day in days.unique():
        own = np.asarray(days == day)
        seconds = (times[own] - times[own][0]).total_seconds().to_numpy()
        found.append([_trapezoid(series, seconds) for series in par[:, own]])
    with np.errstate(invalid="ignore"):
        sums = np.array(found)
        known = np.isfinite(sums)
        mean = np.where(known, sums, 0).sum(axis=0) / known.sum(axis=0)
    return mean * 1e-6


def _trapezoid(series: np.ndarray, seconds: np.ndarray) -> float:
    known = np.isfinite(series)
    if known.sum() < 2:
        return np.nan
    return float(np.trapezoid(series[known], seconds[known]))


def sunflecks(
    par: np.ndarray, direct: np.ndarray, open_beam: np.ndarray, times: pd.DatetimeIndex
) -> Sunflecks:
    """When the sun comes through: more than half of its disc is seen.

    Parameters
    ----------
    par, direct : (n, t) array
        All light, and the direct beam of it [µmol m⁻² s⁻¹].
    open_beam : (t,) array
        The direct beam where no tree stands.
    times : (t,) DatetimeIndex
        On the local clock; evenly spaced, but for nights.

    Returns
    -------
    Sunflecks
    """
    sunny = open_beam > MIN_BEAM
    inside = sunny & (direct > SEEN * np.where(sunny, open_beam, np.inf))
    steps = np.diff(times.to_numpy()) / np.timedelta64(1, "m")
    step_min = float(np.median(steps)) if len(steps) else np.nan
    n_days = len(times.normalize().unique())
    begins = inside & ~np.pad(inside, ((0, 0), (1, 0)))[:, :-1]
    medians = [_median_run(one) * step_min for one in inside]
    with np.errstate(invalid="ignore", divide="ignore"):
        return Sunflecks(
            inside.sum(axis=1) / sunny.sum(),
            np.where(inside, par, 0).sum(axis=1) / par.sum(axis=1),
            begins.sum(axis=1) / n_days,
            np.array(medians),
        )


def _median_run(inside: np.ndarray) -> float:
    """Median length of the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
    return float(np.median(edges[1::2] - edges[::2])) if len(edges) else np.nan
