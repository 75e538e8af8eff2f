"""A sky that is as bright in every direction."""

import numpy as np

from dapple.sky.conditions import Conditions, Ways

COEFFICIENTS = ()


def coefficients(conditions: Conditions) -> np.ndarray:
    """None, (t, 0)."""
    return np.empty((len(conditions.sun_zenith_deg), 0))


def radiance(coefficients: np.ndarray, ways: Ways) -> np.ndarray:
    """1 everywhere."""
    return np.ones_like(ways.cos_sun)
