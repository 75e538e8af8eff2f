"""How well simulated light follows measured light: r, RMSE and bias of records.

Records are a table with one row per reconstruction, sensor and time: columns `reconstruction`,
`sensor`, `time`, `measured`, `simulated` and, where there is one, `baseline` (the same sky without
a tree). Light is PAR [µmol m⁻² s⁻¹]. A record with a missing number counts nowhere.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from dapple.errors import InputError

PER_SENSOR = ["reconstruction", "sensor", "n", "r", "rmse", "bias"]


def pearson(x: np.ndarray, y: np.ndarray) -> float:
    """Pearson's r of two arrays; NaN where one of them is constant or has fewer than two values."""
    if len(x) < 2:
        return np.nan
    dx, dy = x - np.mean(x), y - np.mean(y)
    # Constant up to rounding is constant: 1e-12 of the values is far below any sensor.
    if np.ptp(x) <= 1e-12 * np.abs(x).max() or np.ptp(y) <= 1e-12 * np.abs(y).max():
        return np.nan
    return float(np.clip(dx @ dy / np.sqrt((dx @ dx) * (dy @ dy)), -1.0, 1.0))


def per_sensor(records: pd.DataFrame) -> pd.DataFrame:
    """Agreement of each sensor's series, one row per reconstruction and sensor.

    Returns
    -------
    DataFrame
        `reconstruction, sensor, n, r, rmse, bias`; r is NaN (an empty cell in a file) where the
        measured or the simulated series is constant.
    """
    rows = []
    for reconstruction, group in by_reconstruction(records):
        for sensor, series in group.groupby("sensor", sort=True):
            measured, simulated = series["measured"].to_numpy(), series["simulated"].to_numpy()
            difference = simulated - measured
            rows.append(
                {
                    "reconstruction": reconstruction,
                    "sensor": sensor,
                    "n": len(series),
                    "r": pearson(measured, simulated),
                    "rmse": mean(difference**2) ** 0.5,
                    "bias": mean(difference),
                }
            )
    return pd.DataFrame(rows, columns=PER_SENSOR)


def by_reconstruction(records: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Complete records of each reconstruction, in the order of first appearance."""
    needed = ["reconstruction", "sensor", "time", "measured", "simulated"]
    if missing := [name for name in needed if name not in records]:
        raise InputError(
            "records", f"columns {list(records)}", f"columns {needed}", f"Add {', '.join(missing)}."
        )
    for reconstruction, group in records.groupby("reconstruction", sort=False, observed=True):
        complete = np.isfinite(group[["measured", "simulated"]].to_numpy(float)).all(axis=1)
        yield reconstruction, group[complete].astype({"measured": float, "simulated": float})


def mean(values: np.ndarray) -> float:
    """The mean; NaN of nothing."""
    return float(values.mean()) if len(values) else np.nan
