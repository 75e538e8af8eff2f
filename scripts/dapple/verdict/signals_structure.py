"""Signals of reconstructions: polygons, voxels, and whether both tell of the same crown."""

import math

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from dapple.formats.clouds import LEAF, Cloud
from dapple.formats.meshes import Mesh
from dapple.structure import occlusion
from dapple.structure.voxel_data import CAPPED, DENSITY


def capped_share(voxels: xr.Dataset) -> float:
    """Share of the plant area that lies in voxels at the cap."""
    density = np.nan_to_num(voxels[DENSITY].to_numpy()).astype(np.float64)
    at_cap = (voxels["flag"].to_numpy() & CAPPED) > 0
    total = density.sum()
    return float(density[at_cap].sum() / total) if total > 0 else math.nan


def voxels_per_crown(voxels: xr.Dataset) -> float:
    """Edge of a voxel over the mean diameter of the crown's leafy voxels."""
    leafy = np.argwhere(occlusion.in_crown(voxels[DENSITY].transpose("x", "y", "z").to_numpy()))
    if not len(leafy):
        return math.nan
    return float(1.0 / np.mean(np.ptp(leafy, axis=0) + 1))


def plant_area_index(voxels: xr.Dataset) -> float:
    """Plant area over the ground that leafy voxels stand above [m² m⁻²]."""
    density = voxels[DENSITY].transpose("x", "y", "z").to_numpy()
    density = np.where(occlusion.in_crown(density), np.nan_to_num(density), 0.0)
    columns = density.sum(axis=2, dtype=np.float64) * float(voxels.attrs["voxel_size_m"])
    return float(columns[columns > 0].mean()) if (columns > 0).any() else math.nan


def lacking_share(leaves: Mesh, voxels: xr.Dataset) -> float:
    """Area that polygons lack where coverage is poor (`occlusion.lacking_area`), over their own."""
    if not leaves.n_elements or "entering" not in voxels:
        return math.nan
    return float(occlusion.lacking_area(leaves, voxels)[0].sum() / leaves.area_m2)


def sparse_share(points_per_polygon: np.ndarray | None) -> float:
    """Share of polygons made of one or two points, whose size and angle are chance."""
    if points_per_polygon is None or not len(points_per_polygon):
        return math.nan
    return float((points_per_polygon <= 2).mean())


def distance_to_polygons(
    cloud: Cloud, leaves: Mesh, rng: np.random.Generator, *, points: int = 4000
) -> float:
    """Distance of leaf points from the plane of the nearest polygon, over a polygon's size.

    The nearest is that with the nearest middle; the size is the root of the mean area.
    """
    kinds = cloud.attributes.get("Classification")
    if kinds is None or not leaves.n_elements:
        return math.nan
    leafy = np.flatnonzero(np.asarray(kinds) == LEAF)
    if not len(leafy):
        return math.nan
    xyz = cloud.xyz_m[rng.choice(leafy, min(points, len(leafy)), replace=False, shuffle=False)]
    middle = leaves.element_centre_m
    near = cKDTree(middle, balanced_tree=False, compact_nodes=False).query(xyz)[1]
    normal = leaves.element_normal[near]
    away = np.abs(((xyz - middle[near]) * normal).sum(axis=1))
    return float(away.mean() / math.sqrt(leaves.area_m2 / leaves.n_elements))


def tilt_departure(leaves: Mesh, points_per_polygon: np.ndarray | None) -> float:
    """|mean |cos tilt| - 1/2| of polygons from five points on; 0 for spherical leaf angles."""
    if points_per_polygon is None or len(points_per_polygon) != leaves.n_elements:
        return math.nan
    sure = points_per_polygon >= 5
    if sure.sum() < 20:
        return math.nan
    cosine = np.abs(leaves.element_normal[sure, 2])
    return float(abs(np.average(cosine, weights=leaves.element_area_m2[sure]) - 0.5))


def wood_share(cloud: Cloud) -> float:
    """Share of points that are wood."""
    kinds = cloud.attributes.get("Classification")
    return math.nan if kinds is None or not len(kinds) else float((kinds != LEAF).mean())


def log_ratio(a: float, b: float) -> float:
    """ln(a/b); NaN where either is unknown, ±5 where one is nothing."""
    if not (math.isfinite(a) and math.isfinite(b)) or (a <= 0 and b <= 0):
        return math.nan
    return float(np.clip(math.log(max(a, 1e-9) / max(b, 1e-9)), -5, 5))
