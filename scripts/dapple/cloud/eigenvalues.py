"""Shape of neighbourhoods from the eigenvalues of their scatter."""

from dataclasses import dataclass

import numba
import numpy as np

from dapple.cloud import voxel_groups

COLUMNS = (
    "linearity",
    "planarity",
    "scattering",
    "extent",
    "points",
    "filled",
    "upright_axis",
    "upright_normal",
)
"""What `Neighbourhoods.shape` tells."""


@dataclass(frozen=True)
class Neighbourhoods:
    """All points of a voxel and of the 26 voxels around it, for every voxel that has points.

    Attributes
    ----------
    edge_m : float
        Edge of the voxels [m]; a neighbourhood is three of them wide.
    voxel_of_point : (n,) int64
        The neighbourhood of every point.
    spread_m : (v, 3) float64
        Standard deviations along the principal axes, ascending [m].
    axes : (v, 3, 3) float64
        Unit vectors in columns, in the same order.
    points, filled : (v,) float64
        Number of points, and of voxels that have some.
    mean, deviation, largest : (v, c) float64
        Of c values of the points.
    """

    edge_m: float
    voxel_of_point: np.ndarray
    spread_m: np.ndarray
    axes: np.ndarray
    points: np.ndarray
    filled: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray
    largest: np.ndarray

    @property
    def shape(self) -> np.ndarray:
        """(v, 8) float64, `COLUMNS`.

        Linearity, planarity and scattering (Demantké et al. 2011, from the square roots of the
        eigenvalues), extent in edges, numbers of points and voxels, and the share of the vertical
        in the longest axis and in the normal.
        """
        longest = np.maximum(self.spread_m[:, 2], 1e-9)
        columns = [
            (self.spread_m[:, 2] - self.spread_m[:, 1]) / longest,
            (self.spread_m[:, 1] - self.spread_m[:, 0]) / longest,
            self.spread_m[:, 0] / longest,
            self.spread_m[:, 2] / self.edge_m,
            self.points,
            self.filled,
            np.abs(self.axes[:, 2, 2]),
            np.abs(self.axes[:, 2, 0]),
        ]
        return np.stack(columns, axis=1)


def around(points_m: np.ndarray, edge_m: float, values: np.ndarray | None = None) -> Neighbourhoods:
    """Look at the neighbourhoods of points at one scale.

    Parameters
    ----------
    points_m : (n, 3) float64
        Any frame [m]; voxels start at the lowest corner of the points, wherever that lies.
    edge_m : float
        Edge of the voxels [m].
    values : (n, c) float64 or None
        Numbers of the points whose mean, deviation and maximum are wanted.
    """
    points_m = points_m - points_m.min(axis=0)
    values = np.zeros((len(points_m), 0)) if values is None else values
    groups = voxel_groups.group(points_m, edge_m)
    cell = voxel_groups.cells(points_m[groups.order[groups.start]], edge_m)
    voxel = groups.voxel_of_point
    offset = points_m - (cell[voxel] + 0.5) * edge_m
    x, y, z = offset.T
    products = np.stack([x * x, x * y, x * z, y * y, y * z, z * z], axis=1)
    sums = np.concatenate(
        [groups.size[:, None], groups.total(offset), groups.total(products)], axis=1
    )
    about = np.concatenate([groups.total(values), groups.total(values**2)], axis=1)
    largest = np.maximum.reduceat(values[groups.order], groups.start, axis=0)
    total, about, largest, filled = _summed(cell + 1, edge_m, sums, about, largest)
    n = total[:, :1]
    middle = total[:, 1:4] / n
    scatter = total[:, [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(-1, 3, 3) / n[:, :, None]
    scatter -= middle[:, :, None] * middle[:, None, :]
    variance, axes = np.linalg.eigh(scatter)
    mean, square = np.split(about / n, 2, axis=1)
    return Neighbourhoods(
        edge_m,
        voxel,
        np.sqrt(np.maximum(variance, 0)),
        axes,
        n[:, 0],
        filled.astype(np.float64),
        mean,
        np.sqrt(np.maximum(square - mean**2, 0)),
        largest,
    )


def discriminate(features: np.ndarray, positive: np.ndarray, negative: np.ndarray) -> np.ndarray:
    """Log odds of being positive, after Fisher's linear discriminant between two sure groups.

    Parameters
    ----------
    features : (n, f) float64
    positive, negative : (n,) bool
        Rows that are sure; the others are judged by them.

    Returns
    -------
    (n,) float64
        Above 0 for what is more like the positive, cut at ±3: shape alone is never sure. All 0
        where a group has fewer than ten members for each feature.
    """
    if min(positive.sum(), negative.sum()) < 10 * features.shape[1]:
        return np.zeros(len(features))
    rows = (features - features.mean(axis=0)) / (features.std(axis=0) + 1e-9)
    means = [rows[group].mean(axis=0) for group in (positive, negative)]
    within = 1e-3 * np.eye(rows.shape[1])
    for group, mean in zip((positive, negative), means, strict=True):
        off = rows[group] - mean
        # No matrix product: threads of the linear algebra library would add up in any order.
        within += 0.5 * np.einsum("ni,nj->ij", off, off) / len(off)
    weight = np.linalg.solve(within, means[0] - means[1])
    return np.clip(((rows - 0.5 * (means[0] + means[1])) * weight).sum(axis=1), -3, 3)


@numba.njit(cache=True, parallel=True)
def _summed(cell, edge_m, sums, about, largest):
    """Sums over the 27 voxels around each voxel, moments about its own centre.

    Cells (v, 3) ascend, x slowest, from 1 on.
    """
    n_voxels = len(cell)
    size = np.empty(3, np.int64)
    for a in range(3):
        size[a] = cell[:, a].max() + 2
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    total, around = np.zeros_like(sums), np.zeros_like(about)
    most, filled = largest.copy(), np.zeros(n_voxels, np.int64)
    for v in numba.prange(n_voxels):
        for line in range(9):
            first = key[v] + ((line // 3 - 1) * size[1] + line % 3 - 1) * size[2] - 1
            other = np.searchsorted(key, first)
            while other < n_voxels and key[other] <= first + 2:
                filled[v] += 1
                x = (cell[other, 0] - cell[v, 0]) * edge_m
                y = (cell[other, 1] - cell[v, 1]) * edge_m
                z = (cell[other, 2] - cell[v, 2]) * edge_m
                n, sx, sy, sz = sums[other, 0], sums[other, 1], sums[other, 2], sums[other, 3]
                total[v, 0] += n
                total[v, 1] += sx + n * x
                total[v, 2] += sy + n * y
                total[v, 3] += sz + n * z
                total[v, 4] += sums[other, 4] + 2 * x * sx + n * x * x
                total[v, 5] += sums[other, 5] + x * sy + y * sx + n * x * y
                total[v, 6] += sums[other, 6] + x * sz + z * sx + n * x * z
                total[v, 7] += sums[other, 7] + 2 * y * sy + n * y * y
                total[v, 8] += sums[other, 8] + y * sz + z * sy + n * y * z
                total[v, 9] += sums[other, 9] + 2 * z * sz + n * z * z
                around[v] += about[other]
                most[v] = np.maximum(most[v], largest[other])
                other += 1
    return total, around, most, filled
