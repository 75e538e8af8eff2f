"""Shape of neighbourhoods from the eigenvalues of their scatter, at several scales."""

import numba
import numpy as np
from scipy.spatial import cKDTree

from dapple.cloud import voxel_groups

SCALES = (2.0, 3.5, 7.0)
"""Radii of the neighbourhoods in node sizes."""

NEIGHBOURS = 32


def features(nodes_m: np.ndarray, size_m: float) -> np.ndarray:
    """Shape of the neighbourhood of every node at three scales.

    Parameters
    ----------
    nodes_m : (n, 3) float64
        About one node per voxel of `size_m`, local frame [m].
    size_m : float
        Voxel size of the nodes [m].

    Returns
    -------
    (n, 7 × 3) float64
        For each scale linearity, planarity and scattering (Demantké et al. 2011, from the square
        roots of the eigenvalues), extent relative to the radius, number of neighbours, and the
        share of the vertical in the longest axis and in the normal.
    """
    return np.concatenate([_at_scale(nodes_m, size_m, scale) for scale in SCALES], axis=1)


def shape(points_m: np.ndarray, radius_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Principal axes of the neighbourhoods of points.

    Parameters
    ----------
    points_m : (n, 3) float64
        Local frame [m].
    radius_m : float
        Radius of the neighbourhoods [m]; of more than 32 neighbours the nearest count.

    Returns
    -------
    spread_m : (n, 3) float64
        Standard deviations along the axes, ascending [m].
    axes : (n, 3, 3) float64
        Unit vectors in columns, in the same order.
    n : (n,) int64
        Number of neighbours, the point itself included.
    """
    k = min(NEIGHBOURS, len(points_m))
    _, neighbour = cKDTree(points_m).query(points_m, k, distance_upper_bound=radius_m, workers=-1)
    scatter, n = _scatter(points_m, neighbour.reshape(len(points_m), k))
    values, axes = np.linalg.eigh(scatter)
    return np.sqrt(np.maximum(values, 0)), axes, n


def discriminate(features: np.ndarray, positive: np.ndarray, negative: np.ndarray) -> np.ndarray:
    """Log odds of being positive, after Fisher's linear discriminant between two sure groups.

    Parameters
    ----------
    features : (n, f) float64
        One row a node.
    positive, negative : (n,) bool
        Nodes that are sure; the rest is judged by them.

    Returns
    -------
    (n,) float64
        Above 0 for more like `positive`, cut at ±3; all 0 where a group has fewer than ten
        members for each feature.
    """
    if min(positive.sum(), negative.sum()) < 10 * features.shape[1]:
        return np.zeros(len(features))
    centre, spread = features.mean(axis=0), features.std(axis=0) + 1e-9
    rows = (features - centre) / spread
    means = [rows[group].mean(axis=0) for group in (positive, negative)]
    within = sum(
        _covariance(rows[group] - mean)
        for group, mean in zip((positive, negative), means, strict=True)
    )
    within = 0.5 * within + 1e-3 * np.eye(rows.shape[1])
    weight = np.linalg.solve(within, means[0] - means[1])
    score = ((rows - 0.5 * (means[0] + means[1])) * weight).sum(axis=1)
    return np.clip(score, -3, 3)


def _covariance(rows: np.ndarray) -> np.ndarray:
    # einsum and not a matrix product: threads of the linear algebra library would sum in any order
    return np.einsum("ni,nj->ij", rows, rows) / len(rows)


def _at_scale(nodes_m: np.ndarray, size_m: float, scale: float) -> np.ndarray:
    """Features at one scale, from fewer points where the scale is large."""
    radius_m = scale * size_m
    groups = voxel_groups.group(nodes_m, max(size_m, radius_m / 3))
    spread, axes, n = shape(groups.total(nodes_m) / groups.size[:, None], radius_m)
    longest = np.maximum(spread[:, 2], 1e-9)
    columns = [
        (spread[:, 2] - spread[:, 1]) / longest,
        (spread[:, 1] - spread[:, 0]) / longest,
        spread[:, 0] / longest,
        spread[:, 2] / radius_m,
        n,
        np.abs(axes[:, 2, 2]),
        np.abs(axes[:, 2, 0]),
    ]
    return np.stack(columns, axis=1)[groups.voxel_of_point]


@numba.njit(cache=True)
def _scatter(points, neighbour):
    n_points = len(neighbour)
    scatter, count = np.zeros((n_points, 3, 3)), np.zeros(n_points, np.int64)
    for i in range(n_points):
        mean = np.zeros(3)
        for j in neighbour[i]:
            if j < n_points:
                count[i] += 1
                mean += points[j] - points[i]
        mean /= count[i]
        for j in neighbour[i]:
            if j < n_points:
                d = points[j] - points[i] - mean
                for a in range(3):
                    for b in range(3):
                        scatter[i, a, b] += d[a] * d[b] / count[i]
    return scatter, count
