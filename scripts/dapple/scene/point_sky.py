"""A sky as points of equal solid angle, the sun among them, as scenes are exchanged with it."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dapple.frames import angles_from_direction, direction_from_angles
from dapple.scene import patterns

POINTS = 2000
OUTSHINES = 20.0
"""The brightest point is the sun where it is so many times as bright as the next."""


@dataclass(frozen=True)
class PointSky:
    """Radiance from n points that share the hemisphere evenly.

    Attributes
    ----------
    direction : (n, 3) float64
        Unit vectors towards the points, in the local frame.
    radiance : (n, b) float64
        In b bands [µmol m⁻² s⁻¹ sr⁻¹].
    """

    direction: np.ndarray
    radiance: np.ndarray

    @property
    def solid_angle_sr(self) -> float:
        """Of each point."""
        return 2.0 * np.pi / len(self.direction)

    @property
    def sun(self) -> int | None:
        """Number of the point that is the sun, if any is."""
        total = self.radiance.sum(axis=1)
        first, second = np.argsort(total)[-2:][::-1] if len(total) > 1 else (0, 0)
        return int(first) if total[first] > OUTSHINES * total[second] else None

    def beam(self) -> tuple[float, float, np.ndarray]:
        """Zenith and azimuth of the sun [°] and its irradiance on a plane that faces it, (b,)."""
        if (sun := self.sun) is None:
            return 90.0, 0.0, np.zeros(self.radiance.shape[1])
        zenith, azimuth = angles_from_direction(self.direction[sun])
        return float(zenith), float(azimuth), self.radiance[sun] * self.solid_angle_sr

    def without_sun(self) -> "PointSky":
        """The rest of the sky; the place of the sun is as bright as the nearest other point."""
        if (sun := self.sun) is None:
            return self
        _, nearest = cKDTree(self.direction).query(self.direction[sun], k=2)
        radiance = self.radiance.copy()
        radiance[sun] = radiance[next(one for one in nearest if one != sun)]
        return PointSky(self.direction, radiance)

    def horizontal(self) -> np.ndarray:
        """(b,) irradiance on the level [µmol m⁻² s⁻¹]."""
        return np.maximum(self.direction[:, 2], 0.0) @ self.radiance * self.solid_angle_sr

    def radiance_at(self, band: int, zenith_deg: np.ndarray, azimuth_deg: np.ndarray) -> np.ndarray:
        """Radiance in directions: that of the nearest point."""
        _, nearest = cKDTree(self.direction).query(direction_from_angles(zenith_deg, azimuth_deg))
        return self.radiance[nearest, band]


def even_points(n: int = POINTS) -> np.ndarray:
    """(n, 3) directions that share the upper hemisphere evenly."""
    along, around = patterns.kronecker(n, 2).T
    azimuth, up = 2.0 * np.pi * around, (np.argsort(np.argsort(along)) + 0.5) / n
    level = np.sqrt(1.0 - up**2)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), up], axis=1)


def with_sun(sky: PointSky, towards_sun: np.ndarray, beam_normal: np.ndarray) -> PointSky:
    """Put the sun, of a certain irradiance (b,), into the place of the nearest point."""
    place = int(np.argmax(sky.direction @ towards_sun))
    direction, radiance = sky.direction.copy(), sky.radiance.copy()
    direction[place] = towards_sun
    radiance[place] += beam_normal / sky.solid_angle_sr
    return PointSky(direction, radiance)
