"""The standard clear sky of the CIE, with little haze."""

import numpy as np

from dapple.sky.conditions import Conditions, Ways

COEFFICIENTS = ()
A, B, C, D, E = -1.0, -0.32, 10.0, -3.0, 0.45
"""Of type 12, clear sky of low turbidity."""


def coefficients(conditions: Conditions) -> np.ndarray:
    """None, (t, 0)."""
    return np.empty((len(conditions.sun_zenith_deg), 0))


def radiance(coefficients: np.ndarray, ways: Ways) -> np.ndarray:
    """Standard general sky, in units of its own (CIE S 011, ISO 15469, equations 2 to 5)."""
    gradation = 1 + A * np.exp(B / np.maximum(ways.cos_zenith, 0.01))
    scattered = np.exp(D * np.arccos(ways.cos_sun)) - np.exp(D * np.pi / 2)
    indicatrix = 1 + C * scattered + E * ways.cos_sun**2
    return gradation * indicatrix
