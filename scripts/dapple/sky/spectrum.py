"""The spectrum of sun and sky in the PAR band, from SPECTRL2 and broadband radiation."""

import numpy as np
import pandas as pd
import pvlib

from dapple.optics.bands import band_mean, band_width, photon_flux
from dapple.sky.sun import Site, day_of_year

MAX_ZENITH_DEG = 89.0  # closer to the horizon SPECTRL2 divides by nearly nothing


def par_spectrum(
    times: pd.DatetimeIndex,
    sun_zenith_deg: np.ndarray,
    direct_normal_w_m2: np.ndarray,
    diffuse_w_m2: np.ndarray,
    site: Site,
    wavelength_nm: np.ndarray,
    *,
    ground_albedo: float = 0.2,
    precipitable_water_cm: float = 2.0,
    ozone_atm_cm: float = 0.31,
    aerosol_optical_depth_500nm: float = 0.1,
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
    ground_albedo : float
        Broadband reflectance of the surroundings, 0 to 1.
    precipitable_water_cm, ozone_atm_cm, aerosol_optical_depth_500nm : float
        State of the atmosphere; water matters most (it takes infrared, not PAR).

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
    pressure = pvlib.atmosphere.alt2pres(site.altitude_m)
    model = pvlib.spectrum.spectrl2(
        apparent_zenith=zenith,
        aoi=zenith,
        surface_tilt=0.0,
        ground_albedo=ground_albedo,
        surface_pressure=pressure,
        relative_airmass=pvlib.atmosphere.get_relative_airmass(zenith),
        precipitable_water=precipitable_water_cm,
        ozone=ozone_atm_cm,
        aerosol_turbidity_500nm=aerosol_optical_depth_500nm,
        dayofyear=day_of_year(times),
    )
    nm, beam, sky = model["wavelength"], model["dni"].T, model["dhi"].T
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
