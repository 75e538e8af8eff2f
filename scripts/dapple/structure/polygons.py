"""One planar polygon for the points of every small voxel, after Frey et al. (2025)."""

import math
from collections.abc import Iterator

import numpy as np

from dapple.cloud import voxel_groups
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import meshes
from dapple.formats.meshes import Mesh
from dapple.progress import followed
from dapple.structure import hulls

HALF_POINT_SPACING_M = math.sqrt(2 * 0.01**2) / 2
"""Half the diagonal of the 1 cm grid to which the cloud is thinned (Frey et al. 2025)."""

_MAX_INDEX = 2**20


def reconstruct(
    points_m: np.ndarray,
    *,
    voxel_size_m: float = 0.05,
    buffer_m: float = HALF_POINT_SPACING_M,
    mitre_limit: float = math.sqrt(2),
    seed: int,
    what: str = "cloud",
) -> Mesh:
    """Fit one convex planar polygon to the points of every voxel.

    The points of a voxel are projected on the plane through their mean that fits them best
    (the two axes of largest spread); their convex hull grows outwards. Where points say nothing
    about a plane, chance does:

    - one or two points, or points in one place: a regular hexagon at their mean, a third of the
      voxel size in diameter, its normal uniform on the sphere, turned uniformly in its plane;
    - three or more points on one line: a rectangle that reaches `buffer_m` beyond them on every
      side, turned uniformly about the line (without a buffer: the hexagon).

    Parameters
    ----------
    points_m : (n, 3) float64
        Points of one class in the local frame (east, north, up) [m].
    voxel_size_m : float
        Edge of the cubic voxels; their faces lie at multiples of it from the local origin [m].
    buffer_m : float
        Distance by which each edge of a hull moves outwards in its plane [m].
    mitre_limit : float
        Corners reach at most this multiple of `buffer_m` beyond the hull's corner; sharper ones
        are cut off there at right angles to their bisector. With √2, right and blunt angles keep
        their full corner. The polygon stays convex.
    seed : int
        Chooses the random turns. They depend on the seed and the voxel's place alone: not on
        other voxels, not on the number of threads.
    what : str
        What the points are (leaf, wood), for the error message.

    Returns
    -------
    Mesh
        One element a voxel, in ascending order of the voxels' (x, y, z) index, cut into triangles
        that share the polygon's first vertex; normals of fitted planes do not point downwards;
        areas are one-sided.

    Raises
    ------
    EmptyCloudError
        No point at all: there is nothing to reconstruct.
    InputError
        A coordinate is not a finite number, or the points spread over too many voxels.

    Notes
    -----
    Frey et al. (2025), Silva Fennica 59, 24027, section 2.4. The text is followed where the
    authors' R code differs from it: the code takes a third of the voxel size as the hexagon's
    radius, not its diameter (four times the area); it moves each hull vertex away from the
    centroid by `buffer_m`, so that edges move by less and by different amounts; it turns hexagons
    by at most 45° about each axis, so that most stay near horizontal.
    """
    points_m = np.ascontiguousarray(points_m, np.float64).reshape(-1, 3)
    if voxel_size_m <= 0 or buffer_m < 0 or mitre_limit < 1:
        raise ValueError("voxel_size_m must be positive, buffer_m not negative, mitre_limit ≥ 1")
    if not len(points_m):
        raise EmptyCloudError(
            "polygons",
            f"no {what} points in the cloud",
            "at least one",
            "Look at what the filters left, and check the reflectance threshold.",
        )
    _check_extent(points_m, voxel_size_m, what)
    options = float(voxel_size_m), float(buffer_m), float(mitre_limit), int(seed)
    slices = followed(slabs(points_m, voxel_size_m), f"{what} points", len(points_m), size=len)
    parts = [_of_slab(points_m[slab], *options) for slab in slices]
    return parts[0] if len(parts) == 1 else meshes.concatenate(parts)


def slabs(points_m: np.ndarray, voxel_size_m: float) -> Iterator[np.ndarray]:
    """Indices of points, slab after slab of whole voxels, as `voxel_groups.slabs` has them.

    The polygons of all slabs, one after the other, are those of all points: what needs no more
    than a sum of them takes the memory of a slab.
    """
    yield from voxel_groups.slabs(np.floor(points_m[:, 0] / voxel_size_m).astype(np.int64))


def _of_slab(
    points_m: np.ndarray, voxel_size_m: float, buffer_m: float, mitre_limit: float, seed: int
) -> Mesh:
    index = np.floor(points_m / voxel_size_m).astype(np.int64)
    low = index.min(axis=0)
    n_y, n_z = (index.max(axis=0) - low + 1)[1:]
    key = ((index[:, 0] - low[0]) * n_y + (index[:, 1] - low[1])) * n_z + (index[:, 2] - low[2])
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    start = np.concatenate([first, [len(key)]])
    vertices, place, count = hulls.outlines(
        points_m[order],
        start,
        index[order[first]],
        voxel_size_m,
        buffer_m,
        mitre_limit,
        seed,
    )
    return Mesh(*hulls.fans(vertices, place, count))


def _check_extent(points_m: np.ndarray, voxel_size_m: float, what: str) -> None:
    """The points are finite, and their voxels can be counted."""
    low, high = points_m.min(axis=0), points_m.max(axis=0)
    if not np.isfinite([low, high]).all():
        raise InputError(
            f"{what} points",
            f"{np.count_nonzero(~np.isfinite(points_m).all(axis=1))} points that are not finite",
            "finite coordinates",
            "Filter the cloud or read the file again.",
        )
    span = np.floor(high / voxel_size_m) - np.floor(low / voxel_size_m)
    if span.max() >= _MAX_INDEX:
        raise InputError(
            f"{what} points",
            f"points {span.max() * voxel_size_m:.0f} m apart with voxels of {voxel_size_m} m",
            f"at most {_MAX_INDEX} voxels on a side",
            "Remove far outliers, or cut the cloud into plots.",
        )
