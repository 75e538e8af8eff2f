"""Statistical outliers, by whichever program is there."""

import tempfile
from pathlib import Path

import laspy
import numpy as np

from dapple import pdal as pdal_program
from dapple import programs
from dapple.cloud import cloudcompare as cc
from dapple.cloud.selection import first_at_place
from dapple.errors import InputError

BACKENDS = ("cloudcompare", "pdal", "none")


def inliers(
    xyz_m: np.ndarray,
    backend: str,
    *,
    rows: np.ndarray | None = None,
    neighbours: int = 8,
    multiplier: float = 3.0,
    pdal: str = "pdal",
    cloudcompare: str = "CloudCompare",
) -> tuple[np.ndarray, dict[str, str]]:
    """Find the points that are no statistical outliers (Rusu et al. 2008).

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Local frame [m].
    backend : {"cloudcompare", "pdal", "none"}
        Who finds them; `none` keeps all points.
    rows : (m,) int64 or None
        Points that count; None: all.
    neighbours : int
        Number of nearest neighbours, the point itself not counted.
    multiplier : float
        A point is an outlier if its mean distance to its neighbours exceeds the mean over all
        points by more than this many standard deviations.
    pdal, cloudcompare : str
        Name or path of the programs.

    Returns
    -------
    (k,) int64
        Ascending indices (into `rows` where there are such) of the points that stay. Points at
        exactly one place count once, and share what is found of it: neighbours at no distance
        would make any other place an outlier, and searches among thousands of them do not end.
    dict of str to str
        Version of the program used, by its name.

    Raises
    ------
    InputError
        An unknown back end, or a program is absent.
    ProgramError
        PDAL or CloudCompare failed.

    Notes
    -----
    Both compute the same statistic. CloudCompare stores coordinates and distances in single
    precision and divides the variance by n, PDAL uses double precision and n - 1, so that a point
    within about 1e-6 of the limit may be judged differently.
    """
    if backend not in BACKENDS:
        raise InputError(
            "clean.outlier_backend",
            repr(backend),
            f"one of {', '.join(BACKENDS)}",
            "Change the configuration.",
        )
    # Of what is not kept, large clouds leave no room beside the program.
    place_of_point, once = _places(xyz_m if rows is None else xyz_m[rows])
    if backend == "none" or len(once) <= neighbours:
        return np.arange(len(place_of_point)), {}
    if backend == "pdal":
        kept = _by_pdal(once, neighbours, multiplier, pdal)
        versions = {"pdal": pdal_program.version(pdal)}
    else:
        engine = cc.engine(cloudcompare)
        kept = engine.inliers(once, neighbours, multiplier)
        versions = {engine.name: engine.version}
    stays = np.zeros(len(once), bool)
    stays[kept] = True
    return np.flatnonzero(stays[place_of_point]), versions


def _places(xyz_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The place of every point, and the places themselves in the order of their first points."""
    first = first_at_place(xyz_m)
    once = first == np.arange(len(xyz_m))
    rank = np.cumsum(once, dtype=np.int32) - 1
    return rank[first], xyz_m if once.all() else xyz_m[once]


def _by_pdal(xyz_m: np.ndarray, neighbours: int, multiplier: float, program: str) -> np.ndarray:
    """Points travel as LAS about their middle, to a micrometre, with their row numbers."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_extra_dim(laspy.ExtraBytesParams("Row", np.uint32))
    header.scales = np.full(3, 1e-6)
    points = laspy.LasData(header)
    points.xyz = xyz_m - 0.5 * (np.min(xyz_m, axis=0) + np.max(xyz_m, axis=0))
    points["Row"] = np.arange(len(xyz_m), dtype=np.uint32)
    with tempfile.TemporaryDirectory(prefix="outliers-") as folder:
        given, kept = Path(folder, "given.las"), Path(folder, "kept.las")
        points.write(given)
        stages = pdal_program.remove_outliers(neighbours, multiplier)
        pdal_program.run(
            [str(given), *stages, pdal_program.write_las(kept)],
            program,
            limit_s=programs.limit_s(len(xyz_m)),
        )
        try:
            rows = np.sort(laspy.read(kept)["Row"].astype(np.int64))
        except (laspy.errors.LaspyException, ValueError, KeyError, OSError) as error:
            raise programs.failure(
                [program, "pipeline"], "an output that cannot be read", str(error)
            ) from error
        return rows
