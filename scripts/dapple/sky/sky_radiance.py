"""The light of the sky: its distribution over the directions, and the sky dataset of a series."""

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import InputError
from dapple.formats.netcdf import time_coordinate
from dapple.optics.bands import par_bands
from dapple.sky import models
from dapple.sky.conditions import Conditions, Ways
from dapple.sky.patches import Patches
from dapple.sky.spectrum import par_spectrum
from dapple.sky.sun import Site, direct_normal, extraterrestrial, position
from dapple.times import utc

FLUXES = ("beam_normal_umol_m2_s", "diffuse_horizontal_umol_m2_s")
"""Variables of a sky dataset that carry light, in every band."""


def in_directions(sky: xr.Dataset, zenith_deg: np.ndarray, azimuth_deg: np.ndarray) -> np.ndarray:
    """Relative radiance of a sky.

    Parameters
    ----------
    sky : xarray.Dataset
        Of t times.
    zenith_deg, azimuth_deg : (d...) float
        Directions, azimuth clockwise from north [°].

    Returns
    -------
    (t, d...) float64
        In units of its own, never negative.
    """
    sun = np.atleast_1d(sky["sun_zenith_deg"]), np.atleast_1d(sky["sun_azimuth_deg"])
    ways = Ways.under(*sun, zenith_deg, azimuth_deg)
    found = np.empty((len(sun[0]), 0))
    if "sky_coefficients" in sky:
        found = np.atleast_2d(sky["sky_coefficients"].transpose(..., "coefficient"))
    return models.find(sky.attrs["sky_model"]).radiance(found, ways)


def isotropic(sky: xr.Dataset) -> xr.Dataset:
    """The same light from a sky of even radiance."""
    return sky.drop_dims("coefficient", errors="ignore").assign_attrs(sky_model="isotropic")


def patch_radiance(sky: xr.Dataset, patches: Patches, *, samples: int = 4) -> np.ndarray:
    """Mean radiance of each sky patch for a horizontal irradiance of 1.

    Parameters
    ----------
    sky : xarray.Dataset
        Of t times.
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
    radiance = in_directions(sky, zenith, azimuth).mean(axis=-1)
    return radiance / (radiance @ patches.projected_solid_angle_sr)[:, np.newaxis]


def sky_dataset(
    times: pd.DatetimeIndex,
    site: Site,
    radiation: pd.DataFrame,
    measured: np.ndarray | None = None,
    *,
    model: str,
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
    measured : (t, p) float or None
        Relative radiance of the sky's patches, for the model `measured`.
    model : str
        Distribution of diffuse light over the sky, one of `dapple.sky.models`.
    wavelength_nm : (b,) float or None
        Band centres [nm]; None: 400 to 700 nm in steps of 5 nm.
    ground_albedo, precipitable_water_cm, ozone_atm_cm, aerosol_optical_depth_500nm : float
        See `spectrum.par_spectrum`.

    Returns
    -------
    xarray.Dataset
        Dimensions time, band and, where the model has any, coefficient; zero light while the sun is
        below the horizon.

    Raises
    ------
    InputError
        Naive times, an unknown model or one without its table, or radiation for other times.
    """
    times = utc(times)
    spread = models.find(model)
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
    azimuth = sun["sun_azimuth_deg"].to_numpy()
    found = spread.coefficients(Conditions(zenith, azimuth, beam_w, diffuse_w, outside, measured))
    modelled = radiation.get("modelled", pd.Series(False, index=radiation.index))
    columns = {
        "sun_zenith_deg": (zenith, "degree", "apparent zenith angle of the sun"),
        "sun_azimuth_deg": (
            azimuth,
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
        "sky_coefficients": (found, "1", f"what the sky model {model} has of its own"),
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
        "sky_coefficients": ("coefficient",),
    }
    labels = map(str, range(found.shape[1]) if spread.COEFFICIENTS is None else spread.COEFFICIENTS)
    coordinates = {"coefficient": list(labels)}
    if not found.shape[1]:
        del columns["sky_coefficients"], coordinates["coefficient"]
    return xr.Dataset(
        {
            name: (("time", *second.get(name, ())), values, {"units": unit, "long_name": text})
            for name, (values, unit, text) in columns.items()
        },
        coords={
            "time": time_coordinate(times),
            "wavelength_nm": ("band", bands, {"units": "nm", "long_name": "centre of the band"}),
            **coordinates,
        },
        attrs={
            "sky_model": model,
            "latitude_deg": site.latitude_deg,
            "longitude_deg": site.longitude_deg,
            "altitude_m": site.altitude_m,
        },
    )


def scaled(sky: xr.Dataset, gain: float) -> xr.Dataset:
    """A sky whose sun and sky are brighter by a factor, everything else as it was."""
    with xr.set_options(keep_attrs=True):
        fluxes = {name: gain * sky[name] for name in FLUXES}
    return sky.assign(fluxes).assign_attrs(gain=gain)
