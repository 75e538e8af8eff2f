"""Which directions of a scanner's angular grid are worth firing: those that can meet a box."""

from collections.abc import Iterator

import numpy as np

BLOCK_DIRECTIONS = 200_000
"""Directions that are looked at together: bounds memory, changes no result."""


def through_box(
    origin_m: np.ndarray, direction: np.ndarray, low_m: np.ndarray, high_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distances at which half-lines enter and leave a box.

    Parameters
    ----------
    origin_m, direction : (n, 3) or (3,) float64
        Half-lines.
    low_m, high_m : (3,) float64
        Corners of the box [m].

    Returns
    -------
    enter_m, leave_m : (n,) float64
        Distances along the direction, not below zero; `leave_m < enter_m` where it misses.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low_m - origin_m) / direction, (high_m - origin_m) / direction
    # fmin and fmax pass over the NaN of a line that lies in a face of the box
    enter = np.fmax.reduce(np.fmin(one, other), axis=-1)
    leave = np.fmin.reduce(np.fmax(one, other), axis=-1)
    return np.maximum(enter, 0.0), leave


def angular_box(
    position_m: np.ndarray, low_m: np.ndarray, high_m: np.ndarray
) -> tuple[float, float, float, float]:
    """Azimuths and zenith angles between which every direction to a box lies.

    Parameters
    ----------
    position_m : (3,) float64
        Where the directions start.
    low_m, high_m : (3,) float64
        Corners of the box [m].

    Returns
    -------
    azimuth_low_deg, azimuth_high_deg, zenith_low_deg, zenith_high_deg : float
        Azimuth clockwise from north; the low one may be negative, the span is 360° when the
        position lies above, in or below the box.
    """
    nearest = np.clip(position_m[:2], low_m[:2], high_m[:2]) - position_m[:2]
    near = float(np.hypot(*nearest))
    corners = np.array([(x, y) for x in (low_m[0], high_m[0]) for y in (low_m[1], high_m[1])])
    corners = corners - position_m[:2]
    distances = np.array([near, np.hypot(*corners.T).max()])
    heights = np.array([low_m[2], high_m[2]]) - position_m[2]
    elevation = np.degrees(np.arctan2(heights[:, None], distances[None, :]))
    zenith = 90.0 - elevation.max(), 90.0 - elevation.min()
    if near == 0.0:
        return 0.0, 360.0, *zenith
    to_centre = 0.5 * (low_m[:2] + high_m[:2]) - position_m[:2]
    centre = np.degrees(np.arctan2(to_centre[0], to_centre[1]))
    azimuth = np.degrees(np.arctan2(corners[:, 0], corners[:, 1]))
    turn = (azimuth - centre + 180.0) % 360.0 - 180.0
    return centre + turn.min(), centre + turn.max(), *zenith


def grid_directions(
    position_m: np.ndarray,
    low_m: np.ndarray,
    high_m: np.ndarray,
    *,
    angular_step_deg: float,
    zenith_min_deg: float,
    zenith_max_deg: float,
) -> Iterator[np.ndarray]:
    """Directions of a scanner's grid whose axis meets a box, vertical line by vertical line.

    Parameters
    ----------
    position_m : (3,) float64
        Where the scanner stands [m].
    low_m, high_m : (3,) float64
        Corners of the box [m].
    angular_step_deg : float
        Step of azimuth (from 0°) and of zenith angle (from `zenith_min_deg`).
    zenith_min_deg, zenith_max_deg : float
        Field of view from the zenith.

    Yields
    ------
    (n, 3) float64
        Unit vectors whose components are float32 numbers, so that a file of float32 is exact.
    """
    from_az, to_az, from_zenith, to_zenith = angular_box(position_m, low_m, high_m)
    step = angular_step_deg
    azimuth = np.arange(np.ceil(from_az / step - 1e-9), np.floor(to_az / step + 1e-9) + 1) * step
    if to_az - from_az >= 360.0:
        azimuth = azimuth[azimuth < 360.0 - 1e-6 * step]
    zenith = zenith_min_deg + step * np.arange(
        max(0.0, np.ceil((from_zenith - zenith_min_deg) / step - 1e-9)),
        np.floor((min(to_zenith, zenith_max_deg) - zenith_min_deg) / step + 1e-9) + 1,
    )
    lines = max(1, BLOCK_DIRECTIONS // max(1, len(zenith)))
    for start in range(0, len(azimuth), lines):
        a, z = np.meshgrid(
            np.radians(azimuth[start : start + lines]), np.radians(zenith), indexing="ij"
        )
        rays = np.stack([np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)], axis=-1)
        rays = rays.reshape(-1, 3).astype(np.float32).astype(np.float64)
        enter, leave = through_box(position_m, rays, low_m, high_m)
        yield rays[leave >= enter]
