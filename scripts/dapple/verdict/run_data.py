"""What a run leaves behind and a verdict may look at: no truth in it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from dapple.formats.clouds import LEAF, Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.light.moved_sensors import moved_light
from dapple.optics.responses import Response
from dapple.scene.traced import TracedScene

N_TIMES = 24
"""Times at which light is looked at."""


@dataclass(frozen=True)
class RunData:
    """Data of one run, real or virtual; what a run does not have is None or empty.

    Attributes
    ----------
    shots : Shots or None
        Every shot with its returns, misses included; None where only points are known.
    cloud : Cloud
        Cleaned points with `Classification`, and `Reflectance` and `PointSourceId` where known.
    leaves, wood : Mesh
        Polygons; empty meshes where there are none.
    points_per_polygon : (n_elements,) int or None
        Leaf points that each leaf polygon was made of.
    surfels : Mesh or None
        Discs in the leaves' place.
    surfel_facts : dict
        What was found when they were made (`structure.surfels.reconstruct`).
    beam : dict of str to float
        Of the scanner, fields of `scanner_model.Scanner`; empty: its defaults.
    voxels : dict of str to Dataset
        By reconstruction, as in `voxels_0.2`.
    light, moved_light : dict of str to Dataset
        Light at the sensors by reconstruction, and the same with sensors moved aside.
    sensors_m : (s, 3) float64 or None
        Positions of the sensors, local frame [m].
    sun_zenith_deg, sun_azimuth_deg : (t,) float64 or None
        The sun at the times of `light` [°].
    measured_umol_m2_s : DataArray or None
        Records of PAR at the sensors of `light` (sensor, time), where there are any.
    """

    shots: Shots | None
    cloud: Cloud
    leaves: Mesh
    wood: Mesh
    points_per_polygon: np.ndarray | None = None
    surfels: Mesh | None = None
    surfel_facts: dict[str, Any] = field(default_factory=dict)
    beam: dict[str, float] = field(default_factory=dict)
    voxels: dict[str, xr.Dataset] = field(default_factory=dict)
    light: dict[str, xr.Dataset] = field(default_factory=dict)
    moved_light: dict[str, xr.Dataset] = field(default_factory=dict)
    sensors_m: np.ndarray | None = None
    sun_zenith_deg: np.ndarray | None = None
    sun_azimuth_deg: np.ndarray | None = None
    measured_umol_m2_s: xr.DataArray | None = None


def with_light(
    run: RunData,
    light: dict[str, xr.Dataset],
    scenes_of: Callable[[str], Iterable[TracedScene]],
    *,
    sensors_m: np.ndarray,
    sky: xr.Dataset,
    measured_umol_m2_s: xr.DataArray | None,
    sun_diameter_deg: float,
    aperture_m: float,
    response: Response,
    seed: int,
) -> RunData:
    """Add light at some times of the day, at the sensors and beside them.

    Parameters
    ----------
    run : RunData
    light : dict of str to Dataset
        By reconstruction.
    scenes_of : callable
        Gives the scenes of a reconstruction, one a placement of leaves.
    sensors_m : (s, 3) float64
        Local frame [m].
    sky : Dataset
        Sun and sky at the times of the light.
    measured_umol_m2_s : DataArray or None
        Records (sensor, time).
    sun_diameter_deg, aperture_m : float
        As in `visibility.sunlit`.
    response : Response
        Of the sensors.
    seed : int
        Chooses the directions in which sensors are moved.
    """
    at = np.unique(np.linspace(0, sky.sizes["time"] - 1, N_TIMES).round().astype(int))
    sky = sky.isel(time=at)
    light = {name: one.isel(time=at) for name, one in light.items()}
    return replace(
        run,
        light=light,
        moved_light={
            name: moved_light(
                scenes_of(name),
                sensors_m,
                one,
                sky,
                seed=seed,
                sun_diameter_deg=sun_diameter_deg,
                aperture_m=aperture_m,
                response=response,
            )
            for name, one in light.items()
        },
        sensors_m=sensors_m,
        sun_zenith_deg=sky["sun_zenith_deg"].to_numpy(),
        sun_azimuth_deg=sky["sun_azimuth_deg"].to_numpy(),
        measured_umol_m2_s=measured_umol_m2_s,
    )


def points_per_polygon(cloud: Cloud, leaves: Mesh, voxel_size_m: float) -> np.ndarray | None:
    """How many leaf points each polygon of `structure.polygons.reconstruct` is made of.

    Parameters
    ----------
    cloud : Cloud
        Classified.
    leaves : Mesh
        Its polygons; further ones may have been added at the end.
    voxel_size_m : float
        Edge of the voxels that they were made in [m].

    Returns
    -------
    (k,) int64 or None
        In the order of the elements; None where the polygons are of other points.
    """
    points_m = cloud.xyz_m[cloud.attributes["Classification"] == LEAF]
    index = np.floor(np.asarray(points_m, np.float64) / voxel_size_m).astype(np.int64)
    if not len(index) > 0:
        return None
    counted = np.unique(index, axis=0, return_counts=True)[1]
    return counted if len(counted) <= leaves.n_elements else None
