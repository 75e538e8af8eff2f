"""PAR on the ground around a tree, as far as its shadow reaches."""

import numpy as np
import xarray as xr

from dapple.formats.ground_surface import GroundSurface
from dapple.formats.netcdf import time_coordinate, times
from dapple.light import series, transport, visibility
from dapple.light.light_model import Model, simplified
from dapple.progress import followed
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene
from dapple.scene.traced import load
from dapple.sky.open_sky import towards_sun

LIFT_M = 0.01
"""Height of the map above the ground."""
LOWEST_SUN_DEG = 15.0
"""Shadows of a lower sun are longer than the map."""
MOST_CELLS = 16_000
"""Larger maps get a coarser grid."""
SUN_RAYS, SKY_RAYS, PATHS, ORDERS, TOLERANCE = 256, 256, 64, 4, 0.05
"""Of each point: enough for the eye, a few per cent of the light in the shade."""
MODEL = Model(sky_patches=145, bands=3)
AT_ONCE = 2000
"""Points traced together: what is counted of them stays below some hundred megabytes."""


def par_on_ground(
    scene: Scene,
    ground: GroundSurface,
    sky: xr.Dataset,
    optics: Optics,
    *,
    spacing_m: float,
    margin_m: float,
    sun_diameter_deg: float,
    sun_kernel_deg: float,
    variant: str,
    seed: int,
) -> xr.Dataset:
    """PAR that level points of a regular grid on the ground receive.

    Parameters
    ----------
    scene : Scene
    ground : GroundSurface
        On which the points lie.
    sky : Dataset
        Sun and sky at the times of the maps.
    optics : Optics
    spacing_m, margin_m : float
        Of the grid, and how far it reaches beyond plants and shadows [m].
    sun_diameter_deg, sun_kernel_deg : float
        As in `light_model.Tracing`.
    variant : str
        Of Mitsuba.
    seed : int

    Returns
    -------
    Dataset
        `par_umol_m2_s` (time, y, x) and where the sun stands.
    """
    x, y = grid(scene.bounds_m, ground.lowest_m, sky, spacing_m, margin_m)
    north, east = np.meshgrid(y, x, indexing="ij")
    points = np.column_stack([east.ravel(), north.ravel(), np.zeros(east.size)])
    points[:, 2] = ground.height_m(points[:, :2]) + LIFT_M
    loaded, kept = load(scene, variant), simplified(sky, optics, MODEL)
    parts = []
    for first in followed(range(0, len(points), AT_ONCE), "light on the ground"):
        some = points[first : first + AT_ONCE]
        sunlit = visibility.sunlit(
            loaded,
            some,
            towards_sun(sky),
            tolerance=TOLERANCE,
            max_rays=SUN_RAYS,
            sun_diameter_deg=sun_diameter_deg,
            seed=seed + 2 * first,
        )
        counted = transport.collect(
            loaded,
            some,
            n_paths=PATHS,
            n_sky_rays=SKY_RAYS,
            n_patches=MODEL.sky_patches,
            max_orders=ORDERS,
            seed=seed + 2 * first + 1,
        )
        light = series.compute(sunlit, counted, *kept, sun_kernel_deg=sun_kernel_deg)
        parts.append(light.direct + light.sky + light.scattered)
    par = np.concatenate(parts).T.reshape(-1, *east.shape)
    about = {"units": "µmol m-2 s-1", "long_name": "PAR on the ground"}
    found = xr.Dataset(
        {"par_umol_m2_s": (("time", "y", "x"), par, about)},
        coords={
            "time": time_coordinate(times(sky)),
            "y": ("y", y, {"units": "m", "long_name": "north"}),
            "x": ("x", x, {"units": "m", "long_name": "east"}),
        },
    )
    return found.assign({name: sky[name] for name in ("sun_zenith_deg", "sun_azimuth_deg")})


def grid(
    bounds_m: np.ndarray, ground_z_m: float, sky: xr.Dataset, spacing_m: float, margin_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Centres of cells, east and north [m], around plants and their shadows at all times.

    Parameters
    ----------
    bounds_m : (2, 3) array
        Lowest and highest corner of what stands there [m].
    ground_z_m : float
        Lowest ground [m].
    sky : Dataset
        Where the sun stands.
    spacing_m, margin_m : float
        As in `par_on_ground`; the spacing grows where there were more than `MOST_CELLS`.
    """
    sun = towards_sun(sky)
    sun = sun[sun[:, 2] >= np.sin(np.radians(LOWEST_SUN_DEG))]
    height_m = max(bounds_m[1, 2] - ground_z_m, 0.0)
    shift = np.concatenate([np.zeros((1, 2)), -height_m * sun[:, :2] / sun[:, 2:]])
    low = bounds_m[0, :2] + shift.min(axis=0) - margin_m
    high = bounds_m[1, :2] + shift.max(axis=0) + margin_m
    cells = float(np.prod((high - low) / spacing_m))
    spacing_m *= max(1.0, np.sqrt(cells / MOST_CELLS))
    x, y = (np.arange(low[k], high[k], spacing_m) + spacing_m / 2 for k in (0, 1))
    return x, y
