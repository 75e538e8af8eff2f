"""PAR on the ground around a tree at a few times, by the per-timestep engine."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats.ground_surface import GroundSurface
from dapple.formats.netcdf import time_coordinate, times
from dapple.light.timestep_series import Reference
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene

LIFT_M = 0.01
"""Height of the map above the ground."""


def par_on_ground(
    scene: Scene,
    ground: GroundSurface,
    sky: xr.Dataset,
    optics: Optics,
    *,
    spacing_m: float,
    margin_m: float,
    engine: Mapping[str, Any],
    seed: int,
) -> xr.Dataset:
    """PAR at points of a regular grid on the ground.

    Parameters
    ----------
    scene : Scene
    ground : GroundSurface
        On which the points lie.
    sky : Dataset
        Sun and sky at the times of the maps.
    optics : Optics
    spacing_m, margin_m : float
        Of the grid, and how far it reaches beyond the plants [m].
    engine : mapping
        Settings of `timestep_series.Reference`.
    seed : int

    Returns
    -------
    Dataset
        `par_umol_m2_s` (time, y, x) and where the sun stands.
    """
    low, high = scene.bounds_m
    x, y = (
        np.arange(low[k] - margin_m, high[k] + margin_m, spacing_m) + spacing_m / 2 for k in (0, 1)
    )
    north, east = np.meshgrid(y, x, indexing="ij")
    level = ground.height_m(np.column_stack([east.ravel(), north.ravel()])) + LIFT_M
    points = pd.DataFrame({"x_m": east.ravel(), "y_m": north.ravel(), "z_m": level})
    points.insert(0, "sensor", [f"g{k}" for k in range(len(points))])
    of_time = Reference([scene], sky, optics, **engine, seed=seed)
    series = [of_time.at(k, points)["par_umol_m2_s"] for k in range(sky.sizes["time"])]
    par = np.stack([one.to_numpy().reshape(east.shape) for one in series])
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
