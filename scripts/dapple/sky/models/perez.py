"""The all-weather sky of Perez, Seals and Michalsky (1993), from beam and diffuse radiation."""

import numpy as np
import pvlib

from dapple.sky.conditions import Conditions, Ways

COEFFICIENTS = ("a", "b", "c", "d", "e")

# Perez, Seals and Michalsky (1993), Table 1: for each range of sky clearness (rows) the four
# numbers x1 to x4 of each of the coefficients a to e.
CLEARNESS_BOUNDS = (1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200)
# The fit turns negative under skies that are darker than these. 0.01 and 0.2 are the bounds of
# Radiance's gendaylit; 0.07 is where row 6 becomes positive for every height of the sun.
MIN_BRIGHTNESS = np.array([0.01, 0.2, 0.2, 0.2, 0.2, 0.07, 0.01, 0.01])
PEREZ_TABLE = np.array(
    [
        [
            [1.3525, -0.2576, -0.2690, -1.4366],
            [-0.7670, 0.0007, 1.2734, -0.1233],
            [2.8000, 0.6004, 1.2375, 1.0000],
            [1.8734, 0.6297, 0.9738, 0.2809],
            [0.0356, -0.1246, -0.5718, 0.9938],
        ],
        [
            [-1.2219, -0.7730, 1.4148, 1.1016],
            [-0.2054, 0.0367, -3.9128, 0.9156],
            [6.9750, 0.1774, 6.4477, -0.1239],
            [-1.5798, -0.5081, -1.7812, 0.1080],
            [0.2624, 0.0672, -0.2190, -0.4285],
        ],
        [
            [-1.1000, -0.2515, 0.8952, 0.0156],
            [0.2782, -0.1812, -4.5000, 1.1766],
            [24.7219, -13.0812, -37.7000, 34.8438],
            [-5.0000, 1.5218, 3.9229, -2.6204],
            [-0.0156, 0.1597, 0.4199, -0.5562],
        ],
        [
            [-0.5484, -0.6654, -0.2672, 0.7117],
            [0.7234, -0.6219, -5.6812, 2.6297],
            [33.3389, -18.3000, -62.2500, 52.0781],
            [-3.5000, 0.0016, 1.1477, 0.1062],
            [0.4659, -0.3296, -0.0876, -0.0329],
        ],
        [
            [-0.6000, -0.3566, -2.5000, 2.3250],
            [0.2937, 0.0496, -5.6812, 1.8415],
            [21.0000, -4.7656, -21.5906, 7.2492],
            [-3.5000, -0.1554, 1.4062, 0.3988],
            [0.0032, 0.0766, -0.0656, -0.1294],
        ],
        [
            [-1.0156, -0.3670, 1.0078, 1.4051],
            [0.2875, -0.5328, -3.8500, 3.3750],
            [14.0000, -0.9999, -7.1406, 7.5469],
            [-3.4000, -0.1078, -1.0750, 1.5702],
            [-0.0672, 0.4016, 0.3017, -0.4844],
        ],
        [
            [-1.0000, 0.0211, 0.5025, -0.5119],
            [-0.3000, 0.1922, 0.7023, -1.6317],
            [19.0000, -5.0000, 1.2438, -1.9094],
            [-4.0000, 0.0250, 0.3844, 0.2656],
            [1.0468, -0.3788, -2.4517, 1.4656],
        ],
        [
            [-1.0500, 0.0289, 0.4260, 0.3590],
            [-0.3250, 0.1156, 0.7781, 0.0025],
            [31.0625, -14.5000, -46.1148, 55.3750],
            [-7.2312, 0.4050, 13.3500, 0.6234],
            [1.5000, -0.6426, 1.8564, 0.5636],
        ],
    ]
)


def coefficients(conditions: Conditions) -> np.ndarray:
    """Coefficients a to e.

    Parameters
    ----------
    conditions : Conditions
        At t times.

    Returns
    -------
    (t, 5) float64
        Zero (an isotropic sky) where the sun is down or there is no diffuse light.

    Notes
    -----
    Perez, Seals and Michalsky (1993), "All-weather model for sky luminance distribution", Solar
    Energy 50(3), with the erratum in 51(5): clearness ε and brightness Δ pick a row of Table 1,
    x = x1 + x2 Z + Δ (x3 + x4 Z), and in the first row c and d have their own formulas. The
    brightness is kept within `MIN_BRIGHTNESS` and 0.6, the range of the data. A positive b, with
    which the horizon would be infinitely bright, is set to 0.
    """
    zenith_deg, beam, diffuse = (
        np.asarray(value, float)
        for value in (
            conditions.sun_zenith_deg,
            conditions.direct_normal_w_m2,
            conditions.diffuse_w_m2,
        )
    )
    lit = (zenith_deg < 90.0) & (diffuse > 0)
    zenith = np.radians(np.where(lit, zenith_deg, 0.0))
    safe = np.where(lit, diffuse, 1.0)
    cubed = 1.041 * zenith**3
    clearness = ((safe + np.maximum(beam, 0.0)) / safe + cubed) / (1 + cubed)
    airmass = pvlib.atmosphere.get_relative_airmass(np.degrees(zenith))
    row = np.searchsorted(CLEARNESS_BOUNDS, clearness, side="right")
    brightness = np.clip(
        safe * airmass / conditions.extraterrestrial_w_m2, MIN_BRIGHTNESS[row], 0.6
    )

    x1, x2, x3, x4 = np.moveaxis(PEREZ_TABLE[row], -1, 0)
    z, bright = zenith[:, np.newaxis], brightness[:, np.newaxis]
    coefficients = x1 + x2 * z + bright * (x3 + x4 * z)
    first = row == 0
    (c1, c2, c3, c4), (d1, d2, d3, d4) = PEREZ_TABLE[0, 2:4]
    c = np.exp((brightness * (c1 + c2 * zenith)) ** c3) - c4
    d = -np.exp(brightness * (d1 + d2 * zenith)) + d3 + brightness * d4
    coefficients[first, 2], coefficients[first, 3] = c[first], d[first]
    coefficients[:, 1] = np.minimum(coefficients[:, 1], 0.0)
    return np.where(lit[:, np.newaxis], coefficients, 0.0)


def radiance(coefficients: np.ndarray, ways: Ways) -> np.ndarray:
    """[1 + a exp(b / cosθ)] [1 + c exp(d γ) + e cos²γ], equation 1; never negative."""
    a, b, c, d, e = (ways.of_times(coefficients[..., k]) for k in range(5))
    gradation = 1 + a * np.exp(b / np.maximum(ways.cos_zenith, 0.01))
    indicatrix = 1 + c * np.exp(d * np.arccos(ways.cos_sun)) + e * ways.cos_sun**2
    return np.maximum(gradation * indicatrix, 0.0)
