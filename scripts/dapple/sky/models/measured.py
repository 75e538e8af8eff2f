"""A sky that was measured: the radiance of its patches (`dapple.sky.measured_sky`)."""

import numpy as np

from dapple.errors import InputError
from dapple.frames import direction_from_angles
from dapple.sky.conditions import Conditions, Ways
from dapple.sky.patches import patches

COEFFICIENTS = None
"""As many as the table has patches."""


def coefficients(conditions: Conditions) -> np.ndarray:
    """Relative radiance of every patch (t, p).

    Raises
    ------
    InputError
        There is no table.
    """
    if conditions.measured is None:
        raise InputError(
            "sky model", "measured, and no table", "the radiance of the sky's patches",
            "Set radiation.sky_table.",
        )  # fmt: skip
    return conditions.measured


def radiance(coefficients: np.ndarray, ways: Ways) -> np.ndarray:
    """That of the patch in which a direction lies; the lowest ones reach below the horizon."""
    direction = direction_from_angles(ways.zenith_deg, ways.azimuth_deg)
    direction[..., 2] = np.maximum(direction[..., 2], 0.0)
    return coefficients[..., patches(coefficients.shape[-1]).index(direction)]
