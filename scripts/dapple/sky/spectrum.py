"""The spectrum of sun and sky in the PAR band, from SPECTRL2 and broadband radiation."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pvlib

from dapple.optics.bands import band_mean, band_width, photon_flux
from dapple.sky.sun import Site, day_of_year

MAX_ZENITH_DEG = 89.0  # closer to the horizon SPECTRL2 divides by nearly nothing


@dataclass(frozen=True)
class Atmosphere:
    """What lies above the ground, and the ground's part in it.

    Attributes
    ----------
    ground_albedo : float
        Broadband reflectance of the surroundings, 0 to 1.
    precipitable_water_cm, ozone_atm_cm, aerosol_optical_depth_500nm : float
        Water matters most (it takes infrared, not PAR).
    """

    ground_albedo: float = 0.2
    precipitable_water_cm: float = 2.0
    ozone_atm_cm: float = 0.31
    aerosol_optical_depth_500nm: float = 0.1


def par_spectrum(
    times: pd.DatetimeIndex,
    sun_zenith_deg: np.ndarray,
    direct_normal_w_m2: np.ndarray,
    diffuse_w_m2: np.ndarray,
    site: Site,
    wavelength_nm: np.ndarray,
    **atmosphere: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Photon flux per band of the beam and of the sky.

    The shapes are those of SPECTRL2, scaled so that the integrals over 300 to 4000 nm are the
    given broadband irradiances. Blue sky is seen to the degree to which the beam comes through;
    what is left of the diffuse light, or exceeds a cloudless sky's, is light that clouds or haze
    have scattered, with the shape of global radiation. Under an overcast sky that is all of it
    (a blue sky has 2.7 µmol of PAR per joule, global radiation 2.0).

    Parameters
    ----------
    times : (t,) DatetimeIndex
        Time-zone aware.
    sun_zenith_deg, direct_normal_w_m2, diffuse_w_m2 : (t,) float
        Apparent zenith angle [°]; broadband beam on a plane that faces the sun, and diffuse
        irradiance on the horizontal [W m⁻²].
    site : Site
        Its altitude sets the air pressure.
    wavelength_nm : (b,) float
        Band centres [nm].
    **atmosphere
        As in `Atmosphere`.

    Returns
    -------
    beam_normal_umol_m2_s, diffuse_horizontal_umol_m2_s : (t, b) float64
        Photon flux of each band [µmol m⁻² s⁻¹]; zero where the broadband irradiance is.

    Notes
    -----
    Bird and Riordan (1984), "Simple solar spectral model for direct and diffuse irradiance",
    through pvlib.
    """
    zenith = np.minimum(np.asarray(sun_zenith_deg, float), MAX_ZENITH_DEG)
    nm, beam, sky = _cloudless(
        zenith, day_of_year(times), site.altitude_m, Atmosphere(**atmosphere)
    )
    total = beam * np.cos(np.radians(zenith))[:, np.newaxis] + sky
    beam_w, sky_w, total_w = (np.trapezoid(part, nm, axis=-1) for part in (beam, sky, total))
    cloudless = np.minimum(diffuse_w_m2, sky_w * np.minimum(direct_normal_w_m2 / beam_w, 1.0))

    def photons(shape: np.ndarray, scale: np.ndarray) -> np.ndarray:
        flux = band_mean(nm, photon_flux(shape, nm), wavelength_nm) * band_width(wavelength_nm)
        return flux * np.asarray(scale, float)[:, np.newaxis]

    return (
        photons(beam, direct_normal_w_m2 / beam_w),
        photons(sky, cloudless / sky_w) + photons(total, (diffuse_w_m2 - cloudless) / total_w),
    )


def cloudless_diffuse_share(
    sun_zenith_deg: float, **atmosphere: float
) -> tuple[np.ndarray, np.ndarray]:
    """Share of skylight in the light on level ground under a cloudless sky, at sea level.

    Parameters
    ----------
    sun_zenith_deg : float
    **atmosphere
        As in `Atmosphere`.

    Returns
    -------
    wavelength_nm, share : (k,) float64
        300 to 1100 nm.

    Notes
    -----
    Bird and Riordan (1984), through pvlib. The day of the year changes light, and not its shares.
    """
    zenith = np.minimum([float(sun_zenith_deg)], MAX_ZENITH_DEG)
    nm, beam, sky = _cloudless(zenith, np.ones(1, int), 0.0, Atmosphere(**atmosphere))
    used = (nm >= 300.0) & (nm <= 1100.0)
    sky, beam = sky[0, used], beam[0, used] * np.cos(np.radians(zenith[0]))
    return nm[used], sky / np.maximum(sky + beam, np.finfo(float).tiny)


def _cloudless(
    zenith_deg: np.ndarray, days: np.ndarray, altitude_m: float, atmosphere: Atmosphere
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wavelengths (k,) [nm], and SPECTRL2's beam and sky (t, k) [W m⁻² nm⁻¹]."""
    model = pvlib.spectrum.spectrl2(
        apparent_zenith=zenith_deg,
        aoi=zenith_deg,
        surface_tilt=0.0,
        ground_albedo=atmosphere.ground_albedo,
        surface_pressure=pvlib.atmosphere.alt2pres(altitude_m),
        relative_airmass=pvlib.atmosphere.get_relative_airmass(zenith_deg),
        precipitable_water=atmosphere.precipitable_water_cm,
        ozone=atmosphere.ozone_atm_cm,
        aerosol_turbidity_500nm=atmosphere.aerosol_optical_depth_500nm,
        dayofyear=days,
    )
    return model["wavelength"], model["dni"].T, model["dhi"].T
