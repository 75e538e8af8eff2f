"""Which voxels a cloud is dense enough for."""

import numpy as np
from scipy.spatial import cKDTree

from dapple.structure.polygons import HALF_POINT_SPACING_M

SMALLEST_M = 0.05
"""Frey et al. (2025): about a leaf; smaller voxels cut leaves in pieces."""
SPACINGS = 3.0
"""Points along the edge of a voxel: enough of them lie in it for a hull."""
SAMPLE = 20_000


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
