"""Noise filter: weak and smeared returns, statistical outliers, then one point per small voxel.

The order and the thresholds are those of Frey et al. (2025), Silva Fennica 59, 24027.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np

from dapple import pdal as pdal_program
from dapple.cloud import cloudcompare as cc
from dapple.cloud import voxel_groups
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import clouds
from dapple.formats.cloud_raw import attribute_name
from dapple.formats.clouds import Cloud

OUTLIER_BACKENDS = ("cloudcompare", "pdal", "none")

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
    points_path: str | Path,
    out_path: str | Path,
    *,
    min_reflectance_db: float | None = -15.0,
    max_deviation: float | None = 15.0,
    outlier_backend: str = "cloudcompare",
    outlier_neighbours: int = 8,
    outlier_multiplier: float = 3.0,
    thin_voxel_m: float | None = 0.01,
    min_height_m: float | None = None,
    ground_z_m: float = 0.0,
    pdal: str = "pdal",
    cloudcompare: str = "CloudCompare",
) -> dict:
    """Filter a LAS or LAZ file and write what is left.

    Parameters
    ----------
    points_path, out_path : str or Path
        LAS or LAZ in world coordinates, header offset = world coordinates of the local origin.
    min_reflectance_db : float or None
        Points at or below this `Reflectance` [dB] go; None skips the step.
    max_deviation : float or None
        Points at or above this pulse shape `Deviation` go; None skips the step.
    outlier_backend : {"cloudcompare", "pdal", "none"}
        Who finds statistical outliers; see Notes.
    outlier_neighbours : int
        Number of nearest neighbours, the point itself not counted.
    outlier_multiplier : float
        A point goes if its mean distance to its neighbours exceeds the mean over all points by
        more than this many standard deviations.
    thin_voxel_m : float or None
        Edge of the voxels that keep one point each [m], see `thin`; None skips the step.
    min_height_m : float or None
        Points lower than this above flat ground go [m]; None keeps them all.
    ground_z_m : float
        Height of the ground in the local frame [m].
    pdal, cloudcompare : str
        Name or path of the programs.

    Returns
    -------
    dict
        `input`, `after_height`, `after_reflectance`, `after_deviation`, `after_outliers`,
        `after_thinning`: number of points; `skipped`: list of the steps that were not done and
        why; `outlier_backend` and `versions` of the programs used.

    Raises
    ------
    InputError
        The file is missing or not LAS/LAZ, a parameter is out of range, a program is absent.
    EmptyCloudError
        A filter removed every point; the message names it.
    ProgramError
        PDAL or CloudCompare failed.

    Notes
    -----
    Both back ends compute the same statistic (Rusu et al. 2008, Robotics and Autonomous
    Systems 56). CloudCompare stores coordinates and distances in single precision and divides the
    variance by n, PDAL uses double precision and n - 1, so that a point within about 1e-6 of the
    limit may be judged differently.
    """
    if outlier_backend not in OUTLIER_BACKENDS:
        raise InputError(
            "clean.outlier_backend",
            repr(outlier_backend),
            f"one of {', '.join(OUTLIER_BACKENDS)}",
            "Change the configuration.",
        )
    names, origin_m = _dimensions_and_origin(points_path)
    skipped: list[str] = []
    steps = _steps(names, min_reflectance_db, max_deviation, skipped)
    if min_height_m is not None:
        z_m = origin_m[2] + ground_z_m + min_height_m
        steps = {"height": [pdal_program.keep("Z", f"[{z_m:.4f}:]")], **steps}
    if outlier_backend == "pdal":
        steps["outliers"] = pdal_program.remove_outliers(outlier_neighbours, outlier_multiplier)
    counts, cloud = _filter(points_path, steps, origin_m, pdal)
    versions = {"pdal": pdal_program.version(pdal)}

    if outlier_backend == "cloudcompare":
        engine = cc.engine(cloudcompare)
        kept = engine.inliers(cloud.xyz_m, outlier_neighbours, outlier_multiplier)
        cloud = cloud.select(kept)
        versions[engine.name] = engine.version
    if outlier_backend == "none":
        skipped.append("outliers: outlier_backend is none")
    counts["after_outliers"] = _not_empty(len(cloud), "outliers", counts, points_path)

    if thin_voxel_m is None:
        skipped.append("thinning: thin_voxel_m is not set")
    else:
        cloud = thin(cloud, thin_voxel_m)
    counts["after_thinning"] = len(cloud)
    clouds.write(out_path, cloud)
    return {
        **counts,
        "skipped": skipped,
        "outlier_backend": outlier_backend,
        "versions": versions,
    }


def thin(cloud: Cloud, voxel_size_m: float) -> Cloud:
    """Replace the points of each voxel by one at their centre of gravity.

    PDAL's voxel filters keep a point that exists (the first, the nearest to the centre or to
    the centroid) and never average, hence this one.

    Parameters
    ----------
    cloud : Cloud
        At least one point.
    voxel_size_m : float
        Edge of the voxels [m], aligned to multiples of it from the local origin.

    Returns
    -------
    Cloud
        One point per occupied voxel, in voxel order. Measured attributes are arithmetic means:
        of `Reflectance` the mean of the decibels, not of the power; NaN does not count, whole
        numbers are rounded. `CATEGORIES` take the most frequent value, the smallest of equals.
    """
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


def _dimensions_and_origin(path: str | Path) -> tuple[dict[str, str], np.ndarray]:
    """Our names of the dimensions with those in the file, and the origin of the local frame."""
    if Path(path).suffix.lower() not in (".las", ".laz"):
        raise InputError(path, "another format", "LAS or LAZ", "Bring the scan into LAZ first.")
    first = next(clouds.iterate(path, 1), None)
    if first is None:
        raise EmptyCloudError(path, "no points", "a scan", "Check how the file was exported.")
    with laspy.open(path) as file:
        names = file.header.point_format.dimension_names
        return {attribute_name(name): name for name in names}, first.origin_m


def _steps(
    names: dict[str, str],
    min_reflectance_db: float | None,
    max_deviation: float | None,
    skipped: list[str],
) -> dict[str, list[dict]]:
    """PDAL stages of the two thresholds; what is left out is noted in `skipped`."""
    limits = {
        "reflectance": ("Reflectance", "({}:]", min_reflectance_db),
        "deviation": ("Deviation", "[:{})", max_deviation),
    }
    steps = {}
    for step, (dimension, interval, limit) in limits.items():
        if limit is None:
            skipped.append(f"{step}: no limit is set")
        elif dimension not in names:
            skipped.append(f"{step}: the points have no dimension {dimension}")
        else:
            steps[step] = [pdal_program.keep(names[dimension], interval.format(limit))]
    return steps


def _filter(
    path: str | Path, steps: dict[str, list[dict]], origin_m: np.ndarray, pdal: str
) -> tuple[dict[str, int], Cloud]:
    """Run the steps in one pipeline and count after each; a step not done keeps the number."""
    stages: list[dict | str] = [
        {"type": "readers.las", "filename": str(path)},
        pdal_program.count(),
    ]
    for step in steps.values():
        stages += [*step, pdal_program.count()]
    with tempfile.TemporaryDirectory(prefix="clean-") as folder:
        filtered = Path(folder, "filtered.las")
        result = pdal_program.run([*stages, pdal_program.write_las(filtered, origin_m)], pdal)
        counts = {"input": result.counts[0]}
        seen = dict(zip(steps, result.counts[1:], strict=True))
        for step in ("height", "reflectance", "deviation", "outliers"):
            if step in seen or step != "outliers":
                before = list(counts.values())[-1]
                counts[f"after_{step}"] = _not_empty(seen.get(step, before), step, counts, path)
        cloud = clouds.read(filtered)
    cloud.attributes.pop("ClassFlags", None)  # PDAL's extra copy of the LAS 1.4 flags
    xyz_m = cloud.xyz_m + (cloud.origin_m - origin_m)
    return counts, replace(cloud, xyz_m=xyz_m, origin_m=np.array(origin_m))


def _not_empty(n_points: int, step: str, counts: dict[str, int], path: str | Path) -> int:
    if n_points == 0:
        before = list(counts.values())[-1]
        raise EmptyCloudError(
            path,
            f"no point left of {before} after the {step} filter",
            "some points to keep",
            f"Check the limits of the {step} filter against the values in the file.",
        )
    return n_points
