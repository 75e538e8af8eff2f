"""Plane-parallel layers of leaves with spherical angles, solved by discrete ordinates."""

import numpy as np
import xarray as xr

from dapple.scene.phase import phase_function

N_ANGLES, N_AZIMUTHS, N_DOUBLINGS = 16, 180, 18


def turbid_slab(*leaf_area_index: float, distribution: str = "spherical") -> xr.Dataset:
    """Voxel layers 20 m thick, from below, and so wide that their edges do not matter."""
    size_m, n = 20.0, 400
    across = (np.arange(n) - (n - 1) / 2) * size_m
    density = np.ones((n, n, 1)) * np.array(leaf_area_index) / size_m
    return xr.Dataset(
        {"plant_area_density_m2_m3": (("x", "y", "z"), density)},
        coords={"x": across, "y": across, "z": 11.0 + size_m * np.arange(len(leaf_area_index))},
        attrs={"voxel_size_m": size_m, "leaf_angle_distribution": distribution},
    )


def transmitted_irradiance(
    leaf_area_index: float, reflectance: float, transmittance: float
) -> float:
    """Irradiance below a layer under a sky of radiance 1 [pi: no layer], over black ground."""
    cosine, weight = _angles()
    _, through = layer(leaf_area_index, reflectance, transmittance)
    return float(2 * np.pi * (weight * cosine) @ through.sum(axis=1))


def layer(
    leaf_area_index: float, reflectance: float, transmittance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Reflected and transmitted radiance per incoming one at 16 Gauss angles.

    By doubling a layer so thin that light scatters in it once at most (van de Hulst 1963).
    """
    cosine, weight = _angles()
    depth = 0.5 * leaf_area_index / 2**N_DOUBLINGS / cosine[:, None]
    back, ahead = (depth * part * weight for part in _azimuth_mean(reflectance, transmittance))
    through = np.diag(np.exp(-depth[:, 0])) + ahead
    one = np.eye(N_ANGLES)
    for _ in range(N_DOUBLINGS):
        between = np.linalg.solve(one - back @ back, through)
        back, through = back + through @ back @ between, through @ between
    return back, through


def _angles() -> tuple[np.ndarray, np.ndarray]:
    """Cosines of zenith angles in a hemisphere, and their weights."""
    node, weight = np.polynomial.legendre.leggauss(N_ANGLES)
    return (node + 1) / 2, weight / 2


def _azimuth_mean(reflectance: float, transmittance: float) -> tuple[np.ndarray, np.ndarray]:
    """Source per radiance between all pairs of angles, back and ahead, the azimuth integrated out.

    The phase function integrates to one over the sphere; the albedo is what leaves scatter.
    """
    cosine, _ = _angles()
    sine = np.sqrt(1 - cosine**2)
    azimuth = (np.arange(N_AZIMUTHS) + 0.5) * 2 * np.pi / N_AZIMUTHS
    along = cosine[:, None, None] * cosine[:, None]
    across = sine[:, None, None] * sine[:, None] * np.cos(azimuth)
    albedo = reflectance + transmittance
    if not albedo:
        return np.zeros((N_ANGLES, N_ANGLES)), np.zeros((N_ANGLES, N_ANGLES))
    back, ahead = (
        phase_function(
            np.arccos(np.clip(across + sign * along, -1, 1)),
            np.array(reflectance),
            np.array(transmittance),
        ).mean(axis=-1)
        for sign in (-1, 1)
    )
    return 2 * np.pi * albedo * back, 2 * np.pi * albedo * ahead
