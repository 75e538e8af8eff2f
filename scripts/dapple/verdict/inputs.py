"""What a run leaves behind and a verdict may look at: no truth in it."""

from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots


@dataclass(frozen=True)
class Evidence:
    """Files of one run, real or virtual, in memory; what a run does not have is None or empty.

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
    voxels : dict of str to Dataset
        By reconstruction, as in `voxels_0.2`.
    light, shifted_light : dict of str to Dataset
        Light at the sensors by reconstruction, and the same with sensors moved by `shift_m`.
    sensors_m : (s, 3) float64 or None
        Positions of the sensors, local frame [m].
    sun_zenith_deg, sun_azimuth_deg : (t,) float64 or None
        The sun at the times of `light` [°].
    shift_m : float
        How far sensors were moved for `shifted_light` [m].
    measured_umol_m2_s : DataArray or None
        Records of PAR at the sensors of `light` (sensor, time), where there are any.
    """

    shots: Shots | None
    cloud: Cloud
    leaves: Mesh
    wood: Mesh
    points_per_polygon: np.ndarray | None = None
    voxels: dict[str, xr.Dataset] = field(default_factory=dict)
    light: dict[str, xr.Dataset] = field(default_factory=dict)
    shifted_light: dict[str, xr.Dataset] = field(default_factory=dict)
    sensors_m: np.ndarray | None = None
    sun_zenith_deg: np.ndarray | None = None
    sun_azimuth_deg: np.ndarray | None = None
    shift_m: float = 0.1
    measured_umol_m2_s: xr.DataArray | None = None


def no_mesh() -> Mesh:
    """A mesh without any element."""
    return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))


def count_points(points_m: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """How many points each polygon of `structure.polygons.reconstruct` is made of.

    Parameters
    ----------
    points_m : (n, 3) float64
        Points of one class, local frame [m].
    voxel_size_m : float
        Edge of the voxels that the polygons were made in [m].

    Returns
    -------
    (n_elements,) int64
        In the order of the elements.
    """
    index = np.floor(np.asarray(points_m, np.float64) / voxel_size_m).astype(np.int64)
    if not len(index):
        return np.zeros(0, np.int64)
    return np.unique(index, axis=0, return_counts=True)[1]
