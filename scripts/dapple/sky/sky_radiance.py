"""The light of the sky: its distribution over the directions, and the sky dataset of a series."""

import numpy as np
import pandas as pd
import pvlib
import xarray as xr

from dapple.errors import InputError
from dapple.formats.netcdf import time_coordinate
from dapple.optics.bands import par_bands
from dapple.sky.patches import Patches
from dapple.sky.spectrum import par_spectrum
from dapple.sky.sun import Site, direct_normal, extraterrestrial, position
from dapple.times import utc

COEFFICIENTS = ("a", "b", "c", "d", "e")
SKY_MODELS = ("perez", "isotropic")

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


def perez_coefficients(
    sun_zenith_deg: np.ndarray,
    direct_normal_w_m2: np.ndarray,
    diffuse_w_m2: np.ndarray,
    extraterrestrial_w_m2: np.ndarray,
) -> np.ndarray:
    """Coefficients a to e of the all-weather sky.

    Parameters
    ----------
    sun_zenith_deg, direct_normal_w_m2, diffuse_w_m2 : (t,) float
        Zenith angle of the sun [°]; broadband beam facing the sun and diffuse irradiance on the
        horizontal [W m⁻²].
    extraterrestrial_w_m2 : (t,) float
        Beam outside the atmosphere [W m⁻²].

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
        np.asarray(value, float) for value in (sun_zenith_deg, direct_normal_w_m2, diffuse_w_m2)
    )
    lit = (zenith_deg < 90.0) & (diffuse > 0)
    zenith = np.radians(np.where(lit, zenith_deg, 0.0))
    safe = np.where(lit, diffuse, 1.0)
    cubed = 1.041 * zenith**3
    clearness = ((safe + np.maximum(beam, 0.0)) / safe + cubed) / (1 + cubed)
    airmass = pvlib.atmosphere.get_relative_airmass(np.degrees(zenith))
    row = np.searchsorted(CLEARNESS_BOUNDS, clearness, side="right")
    brightness = np.clip(safe * airmass / extraterrestrial_w_m2, MIN_BRIGHTNESS[row], 0.6)

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


def relative_radiance(
    coefficients: np.ndarray,
    sun_zenith_deg: np.ndarray,
    sun_azimuth_deg: np.ndarray,
    zenith_deg: np.ndarray,
    azimuth_deg: np.ndarray,
) -> np.ndarray:
    """Radiance of the sky in any direction, in arbitrary units.

    Parameters
    ----------
    coefficients : (..., 5) float
        a to e; all zero: 1 everywhere.
    sun_zenith_deg, sun_azimuth_deg : (...) float
        Direction to the sun [°], azimuth clockwise from north.
    zenith_deg, azimuth_deg : (d…) float
        Directions [°].

    Returns
    -------
    (..., d…) float64
        Not normalised, see `diffuse_normalisation`; never negative.
    """
    coefficients = np.asarray(coefficients, float)
    directions = np.broadcast_arrays(np.radians(zenith_deg), np.radians(azimuth_deg))
    spread = (..., *(np.newaxis,) * directions[0].ndim)
    sun = (
        np.radians(np.asarray(angle, float))[spread] for angle in (sun_zenith_deg, sun_azimuth_deg)
    )
    sun_zenith, sun_azimuth = sun
    zenith, azimuth = directions
    cos_gamma = np.cos(sun_zenith) * np.cos(zenith)
    cos_gamma = cos_gamma + np.sin(sun_zenith) * np.sin(zenith) * np.cos(azimuth - sun_azimuth)
    parts = [coefficients[..., k][spread] for k in range(5)]
    return _perez(parts, np.cos(zenith), cos_gamma)


def diffuse_normalisation(coefficients: np.ndarray, sun_zenith_deg: np.ndarray) -> np.ndarray:
    """Horizontal irradiance of a sky of this relative radiance: ∫ L cosθ dω [sr].

    Gauss-Legendre quadrature, cut at the sun's zenith angle and dense near the sun, where the
    radiance has its cusp; relative error below 1e-4.

    Parameters
    ----------
    coefficients : (..., 5) float
    sun_zenith_deg : (...) float
        [°]; a sun below the horizon is taken at the horizon.

    Returns
    -------
    (...) float64
        π for an isotropic sky.
    """
    coefficients = np.asarray(coefficients, float)
    sun = np.radians(np.minimum(np.asarray(sun_zenith_deg, float), 90.0))[..., None, None]
    x, weight = np.polynomial.legendre.leggauss(20)
    x, weight = 0.5 * (x + 1), 0.5 * weight
    # s = x² crowds the nodes at the sun: distance from it grows with x², and so does the weight.
    s, ds = x**2, 2 * x * weight
    below = (sun[..., 0] * (1 - s), sun[..., 0] * ds)
    above = (sun[..., 0] + (np.pi / 2 - sun[..., 0]) * s, (np.pi / 2 - sun[..., 0]) * ds)
    zenith, d_zenith = (
        np.concatenate(pair, axis=-1)[..., None] for pair in zip(below, above, strict=True)
    )
    azimuth, d_azimuth = np.pi * s, np.pi * ds
    cos_gamma = np.cos(sun) * np.cos(zenith) + np.sin(sun) * np.sin(zenith) * np.cos(azimuth)
    parts = [coefficients[..., k][..., None, None] for k in range(5)]
    radiance = _perez(parts, np.cos(zenith), cos_gamma)
    measure = np.cos(zenith) * np.sin(zenith) * d_zenith * d_azimuth
    return 2 * (radiance * measure).sum(axis=(-2, -1))


def patch_radiance(
    coefficients: np.ndarray,
    sun_zenith_deg: np.ndarray,
    sun_azimuth_deg: np.ndarray,
    patches: Patches,
    *,
    samples: int = 4,
) -> np.ndarray:
    """Mean radiance of each sky patch for a horizontal irradiance of 1.

    Parameters
    ----------
    coefficients : (t, 5) float
    sun_zenith_deg, sun_azimuth_deg : (t,) float
        [°], azimuth clockwise from north.
    patches : Patches
    samples : int
        Directions per patch and axis over which the radiance is averaged.

    Returns
    -------
    (t, n) float64
        [sr⁻¹]; times the projected solid angles the sum is 1.
    """
    axis = (np.arange(samples) + 0.5) / samples
    uv = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    direction = patches.sample(uv)
    zenith = np.degrees(np.arccos(np.clip(direction[..., 2], 0.0, 1.0)))
    azimuth = np.degrees(np.arctan2(direction[..., 0], direction[..., 1]))
    radiance = relative_radiance(
        coefficients, sun_zenith_deg, sun_azimuth_deg, zenith, azimuth
    ).mean(axis=-1)
    return radiance / (radiance @ patches.projected_solid_angle_sr)[:, np.newaxis]


def sky_dataset(
    times: pd.DatetimeIndex,
    site: Site,
    radiation: pd.DataFrame,
    *,
    model: str = "perez",
    wavelength_nm: np.ndarray | None = None,
    ground_albedo: float = 0.2,
    precipitable_water_cm: float = 2.0,
    ozone_atm_cm: float = 0.31,
    aerosol_optical_depth_500nm: float = 0.1,
) -> xr.Dataset:
    """Sun and sky above the trees at each time.

    Parameters
    ----------
    times : (t,) DatetimeIndex
        Time-zone aware.
    site : Site
    radiation : pandas.DataFrame
        `global_w_m2`, `diffuse_w_m2` and, where known, `modelled` (t,), in the order of `times`.
    model : {"perez", "isotropic"}
        Distribution of diffuse light over the sky.
    wavelength_nm : (b,) float or None
        Band centres [nm]; None: 400 to 700 nm in steps of 5 nm.
    ground_albedo, precipitable_water_cm, ozone_atm_cm, aerosol_optical_depth_500nm : float
        See `spectrum.par_spectrum`.

    Returns
    -------
    xarray.Dataset
        Dimensions time, band and coefficient; zero light while the sun is below the horizon.

    Raises
    ------
    InputError
        Naive times, an unknown model, or radiation for other times.
    """
    times = utc(times)
    if model not in SKY_MODELS:
        raise InputError("sky model", f"{model!r}", " or ".join(SKY_MODELS), "Choose one.")
    if not utc(radiation.index).equals(times):
        raise InputError(
            "sky dataset", "radiation at other times", "one row per time", "Interpolate it first."
        )
    bands = par_bands() if wavelength_nm is None else np.asarray(wavelength_nm, float)
    sun = position(times, site.latitude_deg, site.longitude_deg, site.altitude_m)
    zenith = sun["sun_zenith_deg"].to_numpy()
    outside = extraterrestrial(times)
    beam_w, diffuse_w = direct_normal(radiation, zenith, outside)
    beam, diffuse = par_spectrum(
        times,
        zenith,
        beam_w,
        diffuse_w,
        site,
        bands,
        ground_albedo=ground_albedo,
        precipitable_water_cm=precipitable_water_cm,
        ozone_atm_cm=ozone_atm_cm,
        aerosol_optical_depth_500nm=aerosol_optical_depth_500nm,
    )
    perez = perez_coefficients(zenith, beam_w, diffuse_w, outside)
    if model == "isotropic":
        perez = np.zeros_like(perez)
    modelled = radiation.get("modelled", pd.Series(False, index=radiation.index))
    columns = {
        "sun_zenith_deg": (zenith, "degree", "apparent zenith angle of the sun"),
        "sun_azimuth_deg": (
            sun["sun_azimuth_deg"].to_numpy(),
            "degree",
            "azimuth of the sun, clockwise from north",
        ),
        "beam_normal_umol_m2_s": (
            beam,
            "umol m-2 s-1",
            "photon flux of the beam in each band on a plane facing the sun",
        ),
        "diffuse_horizontal_umol_m2_s": (
            diffuse,
            "umol m-2 s-1",
            "photon flux of the sky in each band on the horizontal",
        ),
        "perez": (perez, "1", "coefficients a to e of Perez et al. (1993); zero: isotropic"),
        "ghi_w_m2": (
            np.where(zenith < 90.0, radiation["global_w_m2"], 0.0),
            "W m-2",
            "global horizontal irradiance",
        ),
        "dhi_w_m2": (diffuse_w, "W m-2", "diffuse horizontal irradiance"),
        "radiation_modelled": (
            modelled.to_numpy(np.int8),
            "1",
            "1 where radiation comes from the clear-sky model",
        ),
    }
    second = {
        "beam_normal_umol_m2_s": ("band",),
        "diffuse_horizontal_umol_m2_s": ("band",),
        "perez": ("coefficient",),
    }
    return xr.Dataset(
        {
            name: (("time", *second.get(name, ())), values, {"units": unit, "long_name": text})
            for name, (values, unit, text) in columns.items()
        },
        coords={
            "time": time_coordinate(times),
            "wavelength_nm": ("band", bands, {"units": "nm", "long_name": "centre of the band"}),
            "coefficient": list(COEFFICIENTS),
        },
        attrs={
            "sky_model": model,
            "latitude_deg": site.latitude_deg,
            "longitude_deg": site.longitude_deg,
            "altitude_m": site.altitude_m,
        },
    )


def _perez(parts: list[np.ndarray], cos_zenith: np.ndarray, cos_gamma: np.ndarray) -> np.ndarray:
    """[1 + a exp(b / cosθ)] [1 + c exp(d γ) + e cos²γ], Perez et al. (1993), equation 1."""
    a, b, c, d, e = parts
    cos_gamma = np.clip(cos_gamma, -1.0, 1.0)
    gradation = 1 + a * np.exp(b / np.maximum(cos_zenith, 0.01))
    indicatrix = 1 + c * np.exp(d * np.arccos(cos_gamma)) + e * cos_gamma**2
    return np.maximum(gradation * indicatrix, 0.0)
