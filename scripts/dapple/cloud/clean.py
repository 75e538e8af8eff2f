"""Noise filter: weak and smeared returns, statistical outliers, then one point per small voxel.

The order and the thresholds are those of Frey et al. (2025), Silva Fennica 59, 24027.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from dapple.cloud import outliers, voxel_groups
from dapple.cloud.ground_finder import GROUND_CLASS
from dapple.errors import EmptyCloudError
from dapple.formats import ground_surface
from dapple.formats.cloud_raw import joined
from dapple.formats.clouds import Cloud
from dapple.formats.ground_surface import GroundSurface

CATEGORIES = frozenset(
    [
        "Classification",
        "TrueClass",
        "PointSourceId",
        "ReturnNumber",
        "NumberOfReturns",
        "ScanChannel",
        "ScannerChannel",
        "ScanDirectionFlag",
        "EdgeOfFlightLine",
        "UserData",
        "Synthetic",
        "KeyPoint",
        "Withheld",
        "Overlap",
        "ClassFlags",
        "Red",
        "Green",
        "Blue",
    ]
)
"""Attributes whose mean means nothing: a thinned point takes the most frequent value."""


def clean(
    cloud: Cloud,
    *,
    min_reflectance_db: float | None = -15.0,
    max_deviation: float | None = 15.0,
    outlier_backend: str = "cloudcompare",
    outlier_neighbours: int = 8,
    outlier_multiplier: float = 3.0,
    thin_voxel_m: float | None = 0.01,
    min_height_m: float | None = None,
    ground: GroundSurface | None = None,
    pdal: str = "pdal",
    cloudcompare: str = "CloudCompare",
    where: str | Path = "cloud",
) -> tuple[Cloud, dict]:
    """Leave out noise, and leave one point a voxel.

    Parameters
    ----------
    cloud : Cloud
        `Reflectance` [dB] and `Deviation` are filtered by where there are such.
    min_reflectance_db : float or None
        Points at or below this `Reflectance` [dB] go; None skips the step.
    max_deviation : float or None
        Points at or above this pulse shape `Deviation` go; None skips the step.
    outlier_backend, outlier_neighbours, outlier_multiplier, pdal, cloudcompare
        See `outliers.inliers`.
    thin_voxel_m : float or None
        Edge of the voxels that keep one point each [m], see `thin`; None skips the step.
    min_height_m : float or None
        Points lower than this above the ground go, and those of class 2 (ground); None keeps them
        all [m].
    ground : GroundSurface or None
        None: flat ground at 0.
    where : str or Path
        The file to name in errors.

    Returns
    -------
    cloud : Cloud
        What is left.
    counts : dict
        `input`, `after_height`, `after_reflectance`, `after_deviation`, `after_outliers`,
        `after_thinning`: number of points; `skipped`: list of the steps that were not done and
        why; `outlier_backend` and `versions` of the programs used.

    Raises
    ------
    InputError
        An unknown back end, or a program is absent.
    EmptyCloudError
        A filter removed every point; the message names it.
    ProgramError
        PDAL or CloudCompare failed.
    """
    skipped: list[str] = []
    counts = {"input": len(cloud)}
    kept = np.ones(len(cloud), bool)
    for step, chosen in (
        ("height", _above(cloud, ground or ground_surface.flat(0.0), min_height_m)),
        ("reflectance", _within(cloud, "Reflectance", np.greater, min_reflectance_db, skipped)),
        ("deviation", _within(cloud, "Deviation", np.less, max_deviation, skipped)),
    ):
        kept &= chosen
        counts[f"after_{step}"] = _not_empty(int(kept.sum()), step, counts, where)
    rows = np.flatnonzero(kept)
    chosen, versions = outliers.inliers(
        cloud.xyz_m,
        outlier_backend,
        rows=rows if len(rows) < len(cloud) else None,
        neighbours=outlier_neighbours,
        multiplier=outlier_multiplier,
        pdal=pdal,
        cloudcompare=cloudcompare,
    )
    rows = rows[chosen]
    counts["after_outliers"] = _not_empty(len(rows), "outliers", counts, where)
    if outlier_backend == "none":
        skipped.append("outliers: outlier_backend is none")
    if thin_voxel_m is None:
        skipped.append("thinning: thin_voxel_m is not set")
        cloud = cloud.select(rows)
    else:
        cloud = thin(cloud, thin_voxel_m, rows)
    counts["after_thinning"] = len(cloud)
    facts = {"skipped": skipped, "outlier_backend": outlier_backend, "versions": versions}
    return cloud, counts | facts


def _above(cloud: Cloud, ground: GroundSurface, min_height_m: float | None) -> np.ndarray | bool:
    """(n,) bool, points that stand on the ground and are no part of it."""
    if min_height_m is None:
        return True
    high = cloud.xyz_m[:, 2] >= ground.height_m(cloud.xyz_m[:, :2]) + min_height_m
    if "Classification" in cloud.attributes:
        high &= cloud.attributes["Classification"] != GROUND_CLASS
    return high


def _within(
    cloud: Cloud, attribute: str, compare: Callable, limit: float | None, skipped: list[str]
) -> np.ndarray | bool:
    """(n,) bool, points on the right side of a limit; True, and why, where nothing is asked."""
    step = attribute.lower()
    if limit is None:
        skipped.append(f"{step}: no limit is set")
        return True
    if attribute not in cloud.attributes:
        skipped.append(f"{step}: the points have no dimension {attribute}")
        return True
    # In double precision: a limit between two single-precision numbers stays between them.
    return compare(cloud.attributes[attribute].astype(np.float64), limit)


def thin(cloud: Cloud, voxel_size_m: float, rows: np.ndarray | None = None) -> Cloud:
    """Replace the points of each voxel by one at their centre of gravity.

    PDAL's voxel filters keep a point that exists (the first, the nearest to the centre or to
    the centroid) and never average, hence this one.

    Parameters
    ----------
    cloud : Cloud
        At least one point.
    voxel_size_m : float
        Edge of the voxels [m], aligned to multiples of it from the local origin.
    rows : (k,) int64 or None
        Points that count, ascending; None: all.

    Returns
    -------
    Cloud
        One point per occupied voxel, in voxel order. Measured attributes are arithmetic means:
        of `Reflectance` the mean of the decibels, not of the power; NaN does not count, whole
        numbers are rounded. `CATEGORIES` take the most frequent value, the smallest of equals.
    """
    columns = voxel_groups.cells(cloud.xyz_m[:, 0], voxel_size_m)
    columns = columns if rows is None else columns[rows]
    pieces = []
    for slab in voxel_groups.slabs(columns):
        piece = _thinned(cloud.select(slab if rows is None else rows[slab]), voxel_size_m)
        pieces.append({"xyz_m": piece.xyz_m, **piece.attributes})
    attributes = joined(pieces)
    return Cloud(attributes.pop("xyz_m"), cloud.origin_m, attributes)


def _thinned(cloud: Cloud, voxel_size_m: float) -> Cloud:
    groups = voxel_groups.group(cloud.xyz_m, voxel_size_m)
    attributes = {
        name: (_most_frequent if name in CATEGORIES else _mean)(values, groups)
        for name, values in cloud.attributes.items()
    }
    xyz_m = groups.total(cloud.xyz_m) / groups.size[:, None]
    return Cloud(xyz_m, cloud.origin_m, attributes)


def _mean(values: np.ndarray, groups: voxel_groups.Groups) -> np.ndarray:
    known = np.isfinite(values)
    n_known = groups.total(known)
    with np.errstate(invalid="ignore"):
        mean = groups.total(np.where(known, values, 0)) / n_known
    if np.issubdtype(values.dtype, np.integer):
        mean = np.rint(mean)
    return mean.astype(values.dtype)


def _most_frequent(values: np.ndarray, groups: voxel_groups.Groups) -> np.ndarray:
    voxel = groups.voxel_of_point
    order = np.lexsort((values, voxel))
    value, voxel = values[order], voxel[order]
    new_run = np.concatenate([[True], (value[1:] != value[:-1]) | (voxel[1:] != voxel[:-1])])
    run = np.flatnonzero(new_run)
    length = np.diff(run, append=len(value))
    # Longest run first within a voxel; the sort is stable, so the smallest value wins a tie.
    best = np.lexsort((-length, voxel[run]))
    first = np.flatnonzero(np.diff(voxel[run][best], prepend=-1))
    return value[run][best][first]


def _not_empty(n_points: int, step: str, counts: dict[str, int], where: str | Path) -> int:
    if n_points == 0:
        before = list(counts.values())[-1]
        raise EmptyCloudError(
            where,
            f"no point left of {before} after the {step} filter",
            "some points to keep",
            f"Check the limits of the {step} filter against the values in the file.",
        )
    return n_points
