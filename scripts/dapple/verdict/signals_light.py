"""Signals of simulated light: how much it changes with what is not known exactly."""

import math

import numpy as np
import xarray as xr

PAR = "par_umol_m2_s"


def shift_sensitivity(light: xr.Dataset | None, moved: xr.Dataset | None) -> float:
    """Root mean square change of PAR when sensors move a little, over its standard deviation."""
    if light is None or moved is None:
        return math.nan
    here, there = light[PAR].to_numpy(), moved[PAR].to_numpy()
    spread = here.std()
    return float(np.sqrt(((there - here) ** 2).mean()) / spread) if spread > 0 else math.nan


def agreement(one: xr.Dataset | None, other: xr.Dataset | None) -> tuple[float, float]:
    """Correlation of PAR of two reconstructions, and their means' difference over the larger."""
    if one is None or other is None:
        return math.nan, math.nan
    a, b = (light[PAR].to_numpy().ravel() for light in (one, other))
    largest = max(a.mean(), b.mean())
    if largest <= 0:
        return math.nan, math.nan
    r = float(np.corrcoef(a, b)[0, 1]) if min(np.ptp(a), np.ptp(b)) > 0 else math.nan
    return r, float((a.mean() - b.mean()) / largest)


def contrast(light: xr.Dataset | None) -> float:
    """Variation between sensors: standard deviation at a time over the mean, root mean square."""
    if light is None:
        return math.nan
    par = light[PAR].transpose("sensor", "time").to_numpy()
    return float(np.sqrt(par.var(axis=0).mean()) / par.mean()) if par.mean() > 0 else math.nan


def direct_share(light: xr.Dataset | None) -> float:
    """Share of the direct beam in what arrives at the sensors."""
    if light is None:
        return math.nan
    total = float(light[PAR].sum())
    return float(light["par_direct_umol_m2_s"].sum()) / total if total > 0 else math.nan


def best_lag_min(
    light: xr.Dataset | None,
    measured: xr.DataArray | None,
    *,
    max_lag_min: int = 15,
    max_step_min: float = 20.0,
) -> float:
    """Clock offset at which simulated light fits the records best, minutes either way.

    Both are drawn minute by minute between their times, which lie no further apart than
    `max_step_min`; sensors are pooled.
    """
    if light is None or measured is None:
        return math.nan
    simulated, records, when, recorded = _paired(light, measured)
    if not len(records) or when[-1] - when[0] < 4 * max_lag_min:
        return math.nan
    if np.median(np.diff(when)) > max_step_min:
        return math.nan
    first, last = max(when[0], recorded[0]), min(when[-1], recorded[-1])
    minute = np.arange(first, last + 0.5)
    mine = np.array([np.interp(minute, when, row) for row in simulated])
    theirs = np.array([np.interp(minute, recorded, row) for row in records])
    middle = theirs[:, max_lag_min:-max_lag_min]
    n, lags = middle.shape[1], np.arange(-max_lag_min, max_lag_min + 1)
    moved = [mine[:, max_lag_min + lag : max_lag_min + lag + n] for lag in lags]
    fit = [np.corrcoef(one.ravel(), middle.ravel())[0, 1] for one in moved]
    return float(abs(lags[int(np.argmax(fit))])) if np.isfinite(fit).all() else math.nan


def misplaced_share(
    light: xr.Dataset | None, moved: xr.Dataset | None, measured: xr.DataArray | None
) -> float:
    """Share of sensors whose records are like the light beside them rather than at them.

    Sensors moved in any direction: where positions are right, few fit better there; where they
    are wrong by more than the move, half of them.
    """
    if light is None or moved is None or measured is None:
        return math.nan
    here, records, when, recorded = _paired(light, measured)
    there = _paired(moved, measured)[0]
    if not len(records):
        return math.nan
    at = np.array([np.interp(when, recorded, row) for row in records])
    misfit_here, misfit_there = (((one - at) ** 2).mean(axis=1) for one in (here, there))
    differs = np.abs(misfit_there - misfit_here) > 1e-9 * at.var()
    return float((misfit_there < misfit_here)[differs].mean()) if differs.any() else math.nan


def _paired(
    light: xr.Dataset, measured: xr.DataArray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """PAR of light and records by sensor and time, and their times in minutes.

    Sensors without records for a fifth of the time are left out, gaps of the others bridged.
    """
    both = np.intersect1d(light["sensor"].to_numpy(), measured["sensor"].to_numpy())
    records = measured.sel(sensor=both).transpose("sensor", "time")
    kept = both[records.notnull().mean("time").to_numpy() >= 0.8]
    start = light["time"].to_numpy()[0]
    simulated = light[PAR].sel(sensor=kept).transpose("sensor", "time")
    records = records.sel(sensor=kept)
    when, recorded = (
        (one["time"].to_numpy() - start) / np.timedelta64(1, "m") for one in (simulated, records)
    )
    values = records.to_numpy().copy()
    for row in values:
        gap = np.isnan(row)
        row[gap] = np.interp(recorded[gap], recorded[~gap], row[~gap])
    return simulated.to_numpy(), values, when, recorded
