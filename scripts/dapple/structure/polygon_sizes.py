"""Which voxels a cloud is dense enough for, and how much the leaf area hangs on their size."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dapple import findings
from dapple.findings import Finding
from dapple.structure.polygons import reconstruct, slabs

AUTO = "auto"
LEAF_M = 0.05
"""Frey et al. (2025): about a leaf; smaller voxels cut leaves in pieces."""
SPACINGS = 4.0
"""Distances to the fourth neighbour along the edge of a voxel: some 16 points of a leaf in it."""
MOST_LEAVES = 2.0
"""Leaves along the edge of a voxel: a larger hull reaches from leaf to leaf."""
BRACKET = (0.5, 1.0, 2.0)
"""Sizes at which leaf area is told, as shares of the size that is used."""
DOUBTFUL = 2.0
"""Largest over smallest leaf area of the bracket, from which on the size decides the area."""
SAMPLE, NEAR = 20_000, 12


def spacings_m(xyz_m: np.ndarray) -> tuple[float, float]:
    """Median distance of a point from its nearest and from its fourth neighbour [m].

    Points at the same place are no neighbours. On a regular grid of points, and on average where
    points lie by chance, the fourth neighbour is about as far as the square root of the area that
    a point stands for; the nearest is half as far where points lie by chance.

    Parameters
    ----------
    xyz_m : (n, 3) float64

    Returns
    -------
    nearest, fourth : float
        NaN where there are too few points.
    """
    if len(xyz_m) < 2:
        return float("nan"), float("nan")
    some = xyz_m[:: max(1, len(xyz_m) // SAMPLE)]
    tree = cKDTree(xyz_m, balanced_tree=False, compact_nodes=False)
    distance, _ = tree.query(some, k=min(NEAR, len(xyz_m)))
    apart = np.sort(np.where(distance > 0, distance, np.inf), axis=1)
    return _median(apart[:, 0]), _median(apart[:, min(3, apart.shape[1] - 1)])


def _median(distances: np.ndarray) -> float:
    known = distances[np.isfinite(distances)]
    return float(np.median(known)) if len(known) else float("nan")


def fitting(nearest_m: float, fourth_m: float, leaf_size_m: float = LEAF_M) -> dict[str, float]:
    """Size of voxels and growth of hulls that fit a cloud.

    Parameters
    ----------
    nearest_m, fourth_m : float
        As of `spacings_m`.
    leaf_size_m : float
        Width of a leaf [m].

    Returns
    -------
    dict
        `voxel_size_m`: four spacings, but at least one leaf and at most two; `buffer_m`: half the
        diagonal between neighbouring points, by which hulls of points fall short of the surface
        that the points lie on.
    """
    size = min(max(SPACINGS * fourth_m, leaf_size_m), MOST_LEAVES * leaf_size_m)
    size = np.ceil(size / 0.005 - 1e-6) * 0.005
    return {
        "voxel_size_m": round(float(size), 3),
        "buffer_m": round(float(nearest_m / np.sqrt(2)), 6),
    }


def resolved(points_m: np.ndarray, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Options of `polygons.reconstruct` with numbers where `voxel_size_m` is "auto".

    Parameters
    ----------
    points_m : (n, 3) float64
        Leaf points.
    settings : mapping
        Of the section `polygons`; `leaf_size_m` goes.
    """
    options = {key: value for key, value in settings.items() if key != "leaf_size_m"}
    if options.get("voxel_size_m") != AUTO:
        return options
    nearest, fourth = spacings_m(points_m)
    if not (np.isfinite(nearest) and np.isfinite(fourth)):
        nearest = fourth = 0.0
    return options | fitting(nearest, fourth, settings.get("leaf_size_m", LEAF_M))


def bracket(points_m: np.ndarray, *, seed: int, **options: Any) -> dict[str, float]:
    """Leaf area by size of the voxels, at half the size, the size and twice the size [m²].

    Parameters
    ----------
    points_m : (n, 3) float64
        Leaf points.
    seed : int
    **options
        Of `polygons.reconstruct`, sizes as numbers.
    """
    sizes = [round(share * options["voxel_size_m"], 6) for share in BRACKET]
    return {
        f"{size:g}": sum(
            reconstruct(points_m[slab], seed=seed, **options | {"voxel_size_m": size}).area_m2
            for slab in slabs(points_m, size)
        )
        for size in sizes
    }


def doubts(areas_m2: Mapping[str, float], where: str | Path, fit_m: float) -> list[Finding]:
    """A warning where the size of the voxels decides the leaf area.

    Parameters
    ----------
    areas_m2 : mapping
        As of `bracket`.
    where : str or Path
        The cloud, for the message.
    fit_m : float
        Size that fits the cloud [m].
    """
    low, high = min(areas_m2.values()), max(areas_m2.values())
    if high <= DOUBTFUL * low:
        return []
    told = ", ".join(f"{area:.3g} m² with {size} m" for size, area in areas_m2.items())
    return [
        findings.warning(
            where,
            f"a leaf area that hangs on the size of the voxels: {told}",
            "about the same area at half and at twice the size",
            f"Take the area for known no better than that; {fit_m:g} m fits the distance of the "
            "points and the size of leaves.",
            "polygons:\n  voxel_size_m: auto",
        )
    ]
