"""Accuracy against speed: errors, costs and what no other setting beats in both."""

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

COLUMNS = [
    "setting",
    "reconstruction",
    "cost_s",
    "error_rel",
    "on_front",
    "cpu_s",
    "compile_s",
    "error_finest_rel",
    "reference",
    "engine",
    "size_m",
    "paths",
    "sky_patches",
    "max_orders",
    "n_sensors",
    "n_times",
]


def front(cost: ArrayLike, error: ArrayLike) -> np.ndarray:
    """Points that no other beats: none is both at most as dear and at most as wrong (Pareto).

    Parameters
    ----------
    cost, error : (k,) float
        Less is better; NaN is never on the front.

    Returns
    -------
    (k,) bool
        Of equal points the first.
    """
    cost, error = np.asarray(cost, float), np.asarray(error, float)
    on_front = np.zeros(len(cost), bool)
    best = np.inf
    for index in np.lexsort((error, cost)):
        if error[index] < best:
            best = error[index]
            on_front[index] = True
    return on_front


def table(points: list[dict]) -> pd.DataFrame:
    """All points with the front marked, the cheapest first.

    Parameters
    ----------
    points : list of dict
        `COLUMNS` without `on_front`; what does not apply may be left out.
    """
    found = pd.DataFrame(points).reindex(columns=COLUMNS)
    found["on_front"] = front(found["cost_s"], found["error_rel"])
    return found.sort_values("cost_s", kind="stable").reset_index(drop=True)
