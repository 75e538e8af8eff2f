"""How far a signal departs from undisturbed runs, and the loss that follows.

Each signal becomes a departure: how much worse it is than in undisturbed runs, in standard
deviations over disturbed ones, at least 0 and at most `MOST`. The expected loss is a weighted sum.
No weight is negative: a signal can raise an alarm but not call off one, so that trouble of a kind
that was not among the stress runs is still seen by what it disturbs.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from dapple.verdict.signal_meanings import SIGNALS

MOST = 4.0
"""Largest departure that counts."""


def departure(name: str, values: Iterable[float], learned: dict) -> np.ndarray:
    """How much worse a signal is than usual, 0 to `MOST`; 0 where it is unknown."""
    away = (transformed(name, values) - learned["usual"]) / learned["scale"]
    worse = SIGNALS[name].worse
    away = np.abs(away) if worse == 0 else worse * away
    return np.clip(np.nan_to_num(away, nan=0.0), 0.0, MOST)


def transformed(name: str, values: Iterable[float]) -> np.ndarray:
    """Values as they are judged, some by their logarithm."""
    values = np.asarray(values, np.float64)
    return np.log10(np.maximum(values, 0.1)) if SIGNALS[name].is_log else values


def expected_loss(runs: pd.DataFrame, models: dict[str, dict]) -> np.ndarray:
    """(n,) loss that each run's signals make expect (`fitting.losses`); NaN without a model."""
    found = np.full(len(runs), np.nan)
    for reconstruction, model in models.items():
        own = (runs["reconstruction"] == reconstruction).to_numpy()
        total = np.full(int(own.sum()), model["intercept"])
        for name, learned in model["signals"].items():
            values = runs.loc[own, name] if name in runs else np.full(int(own.sum()), np.nan)
            total += learned["weight"] * departure(name, values, learned)
        found[own] = total
    return found
