"""Light where sensors would stand if their positions were a little wrong."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from dapple.light import visibility
from dapple.optics.responses import COSINE, Response
from dapple.scene.traced import TracedScene
from dapple.sky.open_sky import open_beam, towards_sun


def sideways(places_m: np.ndarray, distance_m: float, seed: int) -> np.ndarray:
    """Places (s, 3), each moved level by a distance in a direction of its own [m]."""
    azimuth = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(places_m))
    way = np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], axis=1)
    return places_m + distance_m * way


SHIFT_M = 0.1
"""How far sensors are moved to see how much their light depends on where they stand [m]."""

MAX_RAYS, TOLERANCE = 128, 0.02
"""Shadow rays that are enough to see a difference, and the standard error of the share they see."""


def moved_light(
    scenes: Iterable[TracedScene],
    sensors_m: np.ndarray,
    light: xr.Dataset,
    sky: xr.Dataset,
    *,
    seed: int,
    sun_diameter_deg: float,
    shift_m: float = SHIFT_M,
    max_rays: int = MAX_RAYS,
    tolerance: float = TOLERANCE,
    aperture_m: float = 0.0,
    response: Response = COSINE,
    facing: np.ndarray | None = None,
) -> xr.Dataset:
    """Light at sensors that are moved sideways, each in its own direction.

    Only the direct beam is traced again, at both places: light from the whole sky hardly changes.

    Parameters
    ----------
    scenes : iterable of TracedScene
        One a placement of leaves; their mean counts.
    sensors_m : (s, 3) float64
        Local frame [m].
    light : Dataset
        Light at the sensors.
    sky : Dataset
        Sun and sky at the same times.
    seed : int
        Chooses the directions and shifts the rays.
    sun_diameter_deg : float
        Angular diameter of the disc [deg].
    shift_m : float
        How far they are moved [m].
    max_rays, tolerance, aperture_m
        As in `visibility.sunlit`.
    response : Response
        Of the sensors.
    facing : (s, 3) float64 or None
        Their unit normals; None: they are level.

    Returns
    -------
    Dataset
        Like `light`.
    """
    places = np.concatenate([sensors_m, sideways(sensors_m, shift_m, seed)])
    shares = [
        visibility.sunlit(
            scene,
            places,
            towards_sun(sky),
            tolerance=tolerance,
            max_rays=max_rays,
            seed=seed + number,
            sun_diameter_deg=sun_diameter_deg,
            aperture_m=aperture_m,
            facing=None if facing is None else np.tile(facing, (2, 1)),
        ).share.mean(axis=0)
        for number, scene in enumerate(scenes)
    ]
    here, there = np.split(np.mean(shares, axis=0), 2)
    beam = open_beam(sky, response, facing)
    change = xr.DataArray((there - here) * beam, dims=("sensor", "time"))
    moved = light.copy()
    for name in ("par_umol_m2_s", "par_direct_umol_m2_s"):
        moved[name] = (light[name] + change.to_numpy()).clip(min=0)
    return moved
