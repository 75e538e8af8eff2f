"""What decides how a sky spreads its light, and the directions in which it is asked for it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Conditions:
    """Sun and broadband radiation at t times.

    Attributes
    ----------
    sun_zenith_deg, sun_azimuth_deg : (t,) float64
        Direction to the sun, azimuth clockwise from north [°].
    direct_normal_w_m2, diffuse_w_m2 : (t,) float64
        Beam facing the sun, and diffuse irradiance on the horizontal [W m⁻²].
    extraterrestrial_w_m2 : (t,) float64
        Beam outside the atmosphere [W m⁻²].
    measured : (t, p) float64 or None
        Relative radiance by sky patch, where a sky was measured.
    """

    sun_zenith_deg: np.ndarray
    sun_azimuth_deg: np.ndarray
    direct_normal_w_m2: np.ndarray
    diffuse_w_m2: np.ndarray
    extraterrestrial_w_m2: np.ndarray
    measured: np.ndarray | None = None


@dataclass(frozen=True)
class Ways:
    """Directions under t suns.

    Attributes
    ----------
    zenith_deg, azimuth_deg : (d...) float64
        Azimuth clockwise from north [°].
    cos_zenith : (d...) float64
    cos_sun : (t, d...) float64
        Cosine of the angle between direction and sun.
    """

    zenith_deg: np.ndarray
    azimuth_deg: np.ndarray
    cos_zenith: np.ndarray
    cos_sun: np.ndarray

    @classmethod
    def under(
        cls,
        sun_zenith_deg: np.ndarray,
        sun_azimuth_deg: np.ndarray,
        zenith_deg: np.ndarray,
        azimuth_deg: np.ndarray,
    ) -> "Ways":
        """Directions (d...) under suns (t,), all in degrees."""
        zenith_deg, azimuth_deg = np.broadcast_arrays(zenith_deg, azimuth_deg)
        zenith, azimuth = np.radians(zenith_deg), np.radians(azimuth_deg)
        spread = (..., *(np.newaxis,) * zenith.ndim)
        sun_zenith, sun_azimuth = (
            np.radians(np.asarray(angle, float))[spread]
            for angle in (sun_zenith_deg, sun_azimuth_deg)
        )
        cos_sun = np.cos(sun_zenith) * np.cos(zenith)
        cos_sun = cos_sun + np.sin(sun_zenith) * np.sin(zenith) * np.cos(azimuth - sun_azimuth)
        return cls(zenith_deg, azimuth_deg, np.cos(zenith), np.clip(cos_sun, -1.0, 1.0))

    def of_times(self, values: np.ndarray) -> np.ndarray:
        """Values (t, ...) made to broadcast against (t, d...)."""
        return values[(..., *(np.newaxis,) * self.cos_zenith.ndim)]
