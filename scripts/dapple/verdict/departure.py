"""How suspicious a signal is, and the loss that follows.

Each signal becomes a suspicion: how much worse it is than in undisturbed runs, in standard
deviations over disturbed ones, at least 0 and at most `MOST`. The expected loss is a weighted sum.
No weight is negative: a signal can raise an alarm but not call off one, so that trouble of a kind
that was not in the training is still seen by what it disturbs.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from dapple.verdict.signal_meanings import SIGNALS

MOST = 4.0
"""Largest suspicion that one signal can raise."""


def suspicion(name: str, values: Iterable[float], learned: dict) -> np.ndarray:
    """How much worse a signal is than usual, 0 to `MOST`; 0 where it is unknown."""
    departure = (transformed(name, values) - learned["usual"]) / learned["scale"]
    worse = SIGNALS[name].worse
    departure = np.abs(departure) if worse == 0 else worse * departure
    return np.clip(np.nan_to_num(departure, nan=0.0), 0.0, MOST)


def transformed(name: str, values: Iterable[float]) -> np.ndarray:
    """Values as they are judged, some by their logarithm."""
    values = np.asarray(values, np.float64)
    return np.log10(np.maximum(values, 0.1)) if SIGNALS[name].is_log else values


def expected_loss(runs: pd.DataFrame, models: dict[str, dict]) -> np.ndarray:
    """(n,) loss that each run's signals make expect (`training.losses`); NaN without a model."""
    found = np.full(len(runs), np.nan)
    for method, model in models.items():
        own = (runs["reconstruction"] == method).to_numpy()
        total = np.full(int(own.sum()), model["intercept"])
        for name, learned in model["signals"].items():
            values = runs.loc[own, name] if name in runs else np.full(int(own.sum()), np.nan)
            total += learned["weight"] * suspicion(name, values, learned)
        found[own] = total
    return found
