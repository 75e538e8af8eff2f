"""Which voxels a cloud is dense enough for, and how much its leaf area depends on that choice."""

from collections.abc import Iterable

import numpy as np
from scipy.spatial import cKDTree

from dapple.structure.polygons import HALF_POINT_SPACING_M, reconstruct

SMALLEST_M = 0.05
"""Frey et al. (2025): about a leaf; smaller voxels cut leaves in pieces."""
SPACINGS = 3.0
"""Points along the edge of a voxel: enough of them lie in it for a hull."""
SAMPLE = 20_000
BRACKET = (0.5, 1.0, 2.0)
"""Sizes for which the area is told, in terms of the one chosen."""


def spacing_m(xyz_m: np.ndarray) -> float:
    """Median distance of a point from its nearest neighbour at another place [m].

    Parameters
    ----------
    xyz_m : (n, 3) float64

    Returns
    -------
    float
        NaN where all points are at one place.
    """
    if len(xyz_m) < 2:
        return float("nan")
    some = xyz_m[:: max(1, len(xyz_m) // SAMPLE)]
    tree = cKDTree(xyz_m, balanced_tree=False, compact_nodes=False)
    distance, _ = tree.query(some, k=min(8, len(xyz_m)))
    apart = np.where(distance > 0, distance, np.inf).min(axis=1)
    apart = apart[np.isfinite(apart)]
    return float(np.median(apart)) if len(apart) else float("nan")


def fitting(spacing: float) -> dict[str, float]:
    """Size of voxels and growth of hulls that fit a distance of points [m].

    Returns
    -------
    dict
        `voxel_size_m` and `buffer_m`: half the diagonal between neighbouring points, by which
        hulls of points fall short of the surface that the points lie on.
    """
    size = max(SMALLEST_M, np.ceil(SPACINGS * spacing / 0.005 - 1e-6) * 0.005)
    return {
        "voxel_size_m": round(float(size), 3),
        "buffer_m": round(max(HALF_POINT_SPACING_M, spacing / np.sqrt(2)), 6),
    }


def areas_m2(points_m: np.ndarray, sizes_m: Iterable[float], **settings) -> dict[str, float]:
    """Area of the polygons of some points for each of some voxel sizes [m²]; see `reconstruct`."""
    return {
        f"{size:g}": reconstruct(points_m, voxel_size_m=size, **settings).area_m2
        for size in sizes_m
    }
