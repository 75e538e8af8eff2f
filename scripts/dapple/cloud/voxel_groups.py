"""Points grouped by the voxel they fall in."""

from dataclasses import dataclass

import numpy as np

from dapple.errors import InputError


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
    cell = cells(xyz_m, voxel_size_m)
    cell -= cell.min(axis=0)
    n_cells = [int(n) for n in cell.max(axis=0) + 1]
    if n_cells[0] * n_cells[1] * n_cells[2] >= 2**63:
        raise InputError(
            "point cloud",
            f"an extent of {n_cells} voxels of {voxel_size_m} m",
            "a cloud around one plot",
            "Look for points with absurd coordinates, or clip the cloud.",
        )
    key = np.ravel_multi_index(tuple(cell.T), n_cells)
    order = np.argsort(key, kind="stable")
    key = key[order]
    start = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    return Groups(order, start)


def cells(xyz_m: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """(n, 3) int64 numbers of the voxels that points fall in, counted from the local origin."""
    # A millionth of a voxel: a coordinate stored as a decimal fraction of a world coordinate, as in
    # LAS, may come out a hair below the face it lies on.
    return np.floor(xyz_m / voxel_size_m + 1e-6).astype(np.int64)
