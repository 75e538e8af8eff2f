"""Points grouped by the voxel they fall in."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dapple.errors import InputError

MOST_POINTS = 4_000_000
"""Of a slab: what is done voxel by voxel takes no more memory for a larger cloud."""


@dataclass(frozen=True)
class Groups:
    """Points sorted by voxel.

    Attributes
    ----------
    order : (n,) int64
        Point indices, voxel by voxel (x slowest, z fastest), within a voxel as given.
    start : (v,) int64
        Where each occupied voxel begins in `order`.
    """

    order: np.ndarray
    start: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """(v,) number of points in each occupied voxel."""
        return np.diff(self.start, append=len(self.order))

    @property
    def voxel_of_point(self) -> np.ndarray:
        """(n,) the voxel of every point, in the order of the points."""
        voxel = np.empty(len(self.order), np.int64)
        voxel[self.order] = np.repeat(np.arange(len(self.start)), self.size)
        return voxel

    def total(self, values: np.ndarray) -> np.ndarray:
        """(v, ...) float64 sum of the (n, ...) `values` over each voxel."""
        return np.add.reduceat(values[self.order], self.start, axis=0, dtype=np.float64)


def group(xyz_m: np.ndarray, voxel_size_m: float) -> Groups:
    """Sort points into cubic voxels aligned to multiples of `voxel_size_m` from the local origin.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Local frame [m], finite, n at least 1.
    voxel_size_m : float
        Edge of the voxels [m], above 0. A point on a face belongs to the upper voxel.
    """
    if not voxel_size_m > 0:
        raise InputError("voxel_size_m", str(voxel_size_m), "a size above 0 m", "Change it.")
    low, high = (cells(corner, voxel_size_m) for corner in (xyz_m.min(axis=0), xyz_m.max(axis=0)))
    n_cells = [int(n) for n in high - low + 1]
    if n_cells[0] * n_cells[1] * n_cells[2] >= 2**63:
        raise InputError(
            "point cloud",
            f"an extent of {n_cells} voxels of {voxel_size_m} m",
            "a cloud around one plot",
            "Look for points with absurd coordinates, or clip the cloud.",
        )
    key = np.zeros(len(xyz_m), np.int64)
    for axis, n in enumerate(n_cells):
        key *= n
        key += cells(xyz_m[:, axis], voxel_size_m) - low[axis]
    order = np.argsort(key, kind="stable")
    key = key[order]
    start = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    return Groups(order, start)


def nodes(xyz_m: np.ndarray, voxel_size_m: float, most: int) -> tuple[Groups, np.ndarray, float]:
    """Points of gravity of voxels, which are larger where there would be too many.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        As for `group` [m].
    voxel_size_m : float
        Smallest edge of the voxels [m].
    most : int
        There are no more nodes than this.

    Returns
    -------
    groups : Groups
    nodes_m : (v, 3) float64
        [m]
    voxel_size_m : float
        Edge of the voxels [m].
    """
    while True:
        groups = group(xyz_m, voxel_size_m)
        if len(groups.start) <= most:
            return groups, groups.total(xyz_m) / groups.size[:, None], voxel_size_m
        voxel_size_m *= 1.4


def slabs(columns: np.ndarray) -> Iterator[np.ndarray]:
    """Point indices, slab after slab of whole voxels.

    What is done to each voxel of every slab, one slab after the other, is what would be done to all
    voxels at once: in the same order, and in the memory of one slab.

    Parameters
    ----------
    columns : (n,) int64
        Number along x of the voxel that each point falls in; n at least 1.
    Yields
    ------
    (k,) int64
        Ascending indices of the points of a slab, about `MOST_POINTS` or more where one column has
        more; slabs ascend along x.
    """
    n_slabs = -(-len(columns) // MOST_POINTS)
    if n_slabs == 1:
        yield np.arange(len(columns))
        return
    some = np.sort(columns[:: max(1, len(columns) // (1000 * n_slabs))])
    first = np.unique(some[np.arange(1, n_slabs) * len(some) // n_slabs])
    slab = np.searchsorted(first, columns, side="right").astype(np.int32)
    del columns
    for k in range(len(first) + 1):
        chosen = np.flatnonzero(slab == k)
        if len(chosen):
            yield chosen


def cells(xyz_m: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Numbers of the voxels that points fall in, int64, counted from the local origin.

    Of the three axes for (n, 3) coordinates, of one for (n,).
    """
    # A millionth of a voxel: a coordinate stored as a decimal fraction of a world coordinate, as in
    # LAS, may come out a hair below the face it lies on.
    return np.floor(xyz_m / voxel_size_m + 1e-6).astype(np.int64)
