"""The traditional overcast sky of the CIE: three times as bright overhead as at the horizon."""

import numpy as np

from dapple.sky.conditions import Conditions, Ways

COEFFICIENTS = ()


def coefficients(conditions: Conditions) -> np.ndarray:
    """None, (t, 0)."""
    return np.empty((len(conditions.sun_zenith_deg), 0))


def radiance(coefficients: np.ndarray, ways: Ways) -> np.ndarray:
    """(1 + 2 cosθ) / 3 of the zenith's (Moon and Spencer 1942; CIE S 011, ISO 15469, type 16)."""
    return np.broadcast_to((1 + 2 * ways.cos_zenith) / 3, ways.cos_sun.shape)
