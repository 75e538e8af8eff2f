"""Ground under an airborne cloud: cloth simulation, elevation and canopy height models."""

import CSF
import numpy as np
from scipy import ndimage
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from threadpoolctl import threadpool_limits

from dapple.cloud.selection import without_marked
from dapple.errors import EmptyCloudError, InputError
from dapple.formats.clouds import Cloud
from dapple.formats.rasters import Raster
from dapple.programs import silenced

MOST_CELLS = 50_000_000
"""A table of more columns than this is not made."""


def isolated(xyz_m: np.ndarray, *, cell_m: float, most_points: int) -> np.ndarray:
    """Mark points that have almost no others around them: birds, echoes from below the ground.

    A point is isolated if its cubic cell and the 26 around it hold no more than `most_points`.
    Unlike a statistic over nearest neighbours it takes seconds for ten million points.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Points in the local frame [m].
    cell_m : float
        Edge of the cells [m].
    most_points : int
        Up to so many points, itself among them, are noise; 0 keeps all.

    Returns
    -------
    (n,) bool
    """
    index = np.floor((xyz_m - xyz_m.min(axis=0)) / cell_m).astype(np.int64) + 1
    shape = index.max(axis=0) + 2
    key = np.ravel_multi_index(index.T, shape)
    cells, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    around = np.zeros(len(cells), np.int64)
    steps = np.array(np.unravel_index(np.arange(27), (3, 3, 3))).T - 1
    for step in steps @ np.array([shape[1] * shape[2], shape[2], 1]):
        place = np.minimum(np.searchsorted(cells, cells + step), len(cells) - 1)
        around += np.where(cells[place] == cells + step, counts[place], 0)
    return (around <= most_points)[inverse]


def lowest(xyz_m: np.ndarray, *, cell_m: float) -> np.ndarray:
    """Indices of the lowest point of every column of ground area `cell_m`², ascending."""
    cell = np.floor((xyz_m[:, :2] - xyz_m[:, :2].min(axis=0)) / cell_m).astype(np.int64)
    key = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
    if key.max() > MOST_CELLS:
        key = np.unique(key, return_inverse=True)[1]
    least = np.full(key.max() + 1, np.inf)
    np.minimum.at(least, key, xyz_m[:, 2])
    candidates = np.flatnonzero(xyz_m[:, 2] == least[key])
    _, first = np.unique(key[candidates], return_index=True)
    return np.sort(candidates[first])


def cloth(
    xyz_m: np.ndarray,
    *,
    cloth_m: float,
    rigidness: int,
    threshold_m: float,
    least_share: float = 0.1,
    where: str = "points",
) -> np.ndarray:
    """Mark ground points: those near a cloth that falls on the cloud turned upside down.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Points in the local frame [m]; the lowest of each small column are enough.
    cloth_m : float
        Distance of the cloth's knots [m].
    rigidness : int
        1 steep slopes, 2 hills, 3 flat land.
    threshold_m : float
        Points at most so far from the cloth are ground [m].
    least_share : float
        Share of the area that has to have ground.
    where : str
        File to name in errors.

    Returns
    -------
    (n,) bool

    Raises
    ------
    EmptyCloudError
        No point.
    InputError
        Ground under a smaller share of the area: the cloud holds canopy alone.

    Notes
    -----
    Zhang et al. (2016), Remote Sensing 8, 501, by their own library (`cloth-simulation-filter`).
    PDAL's filters.csf is the same algorithm, but aborts in PDAL 2.2 (bad_alloc).
    """
    if not len(xyz_m):
        raise EmptyCloudError(where, "0 points", "at least one point", "Check the export.")
    filter_ = CSF.CSF()
    filter_.params.bSloopSmooth = True
    filter_.params.cloth_resolution = cloth_m
    filter_.params.rigidness = rigidness
    filter_.params.class_threshold = threshold_m
    filter_.setPointCloud(np.ascontiguousarray(xyz_m, np.float64))
    ground, above = CSF.VecInt(), CSF.VecInt()
    # Threads of the library wait by computing: on a busy machine one is faster than two.
    with silenced(1), threadpool_limits(1, "openmp"):
        filter_.do_filtering(ground, above, False)
    mask = np.zeros(len(xyz_m), bool)
    mask[np.asarray(ground, dtype=np.int64)] = True
    share = covered_share(xyz_m, mask, 4 * cloth_m)
    if share < least_share:
        raise InputError(
            where,
            f"ground under {100 * share:.0f} % of the area",
            "a cloud that reaches the ground",
            "Give the cloud with its ground returns; where the ground is steep, raise "
            "chlorophyll.crowns.ground_threshold_m or lower ground_rigidness.",
        )
    return mask


def covered_share(xyz_m: np.ndarray, mask: np.ndarray, cell_m: float) -> float:
    """Share of the occupied cells that hold a marked point."""
    cell = np.floor((xyz_m[:, :2] - xyz_m[:, :2].min(axis=0)) / cell_m).astype(np.int64)
    key = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
    return len(np.unique(key[mask])) / len(np.unique(key))


def grid_of(world_xy_m: np.ndarray, pixel_m: float) -> tuple[float, float, int, int]:
    """The grid of whole pixels over points: left, top [m], rows, columns."""
    low, high = world_xy_m.min(axis=0), world_xy_m.max(axis=0)
    left, top = np.floor(low[0] / pixel_m) * pixel_m, np.ceil(high[1] / pixel_m) * pixel_m
    # Counted as `Raster.pixel_of` counts: a point on a line between pixels lies in the next one.
    rows, columns = np.floor([(top - low[1]) / pixel_m, (high[0] - left) / pixel_m]).astype(int) + 1
    return left, top, int(rows), int(columns)


def elevation(world_xyz_m: np.ndarray, extent_m: np.ndarray, *, pixel_m: float, crs: str) -> Raster:
    """Digital elevation model: the median of the ground points of a pixel, gaps interpolated.

    Parameters
    ----------
    world_xyz_m : (n, 3) float64
        Ground points, world coordinates [m].
    extent_m : (m, 2) float64
        Points to cover, world east and north [m]: the whole cloud, or two of its corners.
    pixel_m : float
    crs : str

    Returns
    -------
    Raster
        Band "elevation_m", without gaps: linear between pixels with ground, beyond them the
        nearest pixel's.
    """
    left, top, rows, columns = grid_of(extent_m, pixel_m)
    raster = Raster(
        np.full((1, rows, columns), np.nan, np.float32), left, top, pixel_m, crs, ("elevation_m",)
    )
    row, column = raster.pixel_of(world_xyz_m[:, :2])
    base = world_xyz_m[:, 2].min()
    median = _by_pixel(row * columns + column, world_xyz_m[:, 2] - base, rows * columns)
    known = np.flatnonzero(np.isfinite(median))
    places = np.stack(np.unravel_index(known, (rows, columns)), axis=1).astype(float)
    everywhere = np.moveaxis(np.mgrid[:rows, :columns], 0, -1).reshape(-1, 2).astype(float)
    filled = np.full(rows * columns, np.nan)
    if len(known) > 3 and np.ptp(places, axis=0).min() > 0:
        filled = LinearNDInterpolator(places, median[known])(everywhere)
    gaps = np.isnan(filled)
    if gaps.any():
        filled[gaps] = NearestNDInterpolator(places, median[known])(everywhere[gaps])
    raster.values[0] = (filled + base).reshape(rows, columns)
    return raster


def _by_pixel(key: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """Median of the values of each pixel, NaN where there is none."""
    order = np.lexsort((values, key))
    counts = np.bincount(key, minlength=n)
    first = np.cumsum(counts) - counts
    known = counts > 0
    result = np.full(n, np.nan)
    low, high = first + (counts - 1) // 2, first + counts // 2
    ordered = values[order]
    result[known] = 0.5 * (ordered[low[known]] + ordered[high[known]])
    return result


def heights(world_xyz_m: np.ndarray, dem: Raster) -> np.ndarray:
    """(n,) heights above the elevation model, bilinear between the centres of pixels [m]."""
    row = (dem.top_m - world_xyz_m[:, 1]) / dem.pixel_m - 0.5
    column = (world_xyz_m[:, 0] - dem.left_m) / dem.pixel_m - 0.5
    ground = ndimage.map_coordinates(
        dem.values[0].astype(np.float64), [row, column], order=1, mode="nearest"
    )
    return world_xyz_m[:, 2] - ground


def spacing_m(xyz_m: np.ndarray, cell_m: float = 1.0) -> float:
    """Mean horizontal distance of points, from the median of the points in a square metre."""
    cell = np.floor((xyz_m[:, :2] - xyz_m[:, :2].min(axis=0)) / cell_m).astype(np.int64)
    counts = np.bincount(cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1])
    return float(cell_m / np.sqrt(np.median(counts[counts > 0])))


def canopy_height(
    world_xy_m: np.ndarray, height_m: np.ndarray, dem: Raster, *, pixel_m: float, reach_m: float
) -> Raster:
    """Canopy height model: the highest point of a pixel, gaps filled by the nearest pixel.

    Parameters
    ----------
    world_xy_m : (n, 2) float64
        East and north [m].
    height_m : (n,) float64
        Above the ground [m]; what lies below it counts as 0.
    dem : Raster
        Gives the corner and the coordinate system.
    pixel_m : float
    reach_m : float
        Pixels farther than this from a pixel with points stay NaN [m].

    Returns
    -------
    Raster
        Band "height_m".
    """
    left, top, rows, columns = grid_of(world_xy_m, pixel_m)
    raster = Raster(
        np.full((1, rows, columns), -np.inf, np.float32), left, top, pixel_m, dem.crs, ("height_m",)
    )
    np.maximum.at(
        raster.values[0], raster.pixel_of(world_xy_m), np.maximum(height_m, 0).astype(np.float32)
    )
    empty = np.isinf(raster.values[0])
    distance, nearest = ndimage.distance_transform_edt(empty, return_indices=True)
    raster.values[0] = raster.values[0][tuple(nearest)]
    raster.values[0][distance * pixel_m > reach_m] = np.nan
    return raster


def without_noise(cloud: Cloud, where: str, *, cell_m: float, most_points: int) -> Cloud:
    """Drop points that the file calls noise or withholds, and isolated ones.

    Raises
    ------
    EmptyCloudError
        Nothing is left.
    """
    cloud = without_marked(cloud, where)[0]
    cloud = cloud.select(~isolated(cloud.xyz_m, cell_m=cell_m, most_points=most_points))
    if not len(cloud):
        raise EmptyCloudError(
            where,
            "noise alone",
            "points of ground and canopy",
            "Check the classes, or lower chlorophyll.crowns.noise_points.",
        )
    return cloud


def model(
    world_xyz_m: np.ndarray,
    *,
    crs: str,
    where: str,
    pixel_m: float,
    cell_m: float,
    cloth_m: float,
    rigidness: int,
    threshold_m: float,
) -> tuple[Raster, np.ndarray]:
    """Elevation model of a cloud, and the indices of its ground points.

    The cloth falls on the lowest point of each `cell_m`: for the cloth the others do not matter,
    and it takes seconds instead of minutes. The lowest points lie below the mean ground by the
    scanner's noise. So all points within the threshold of a first model from them give the final
    one.

    Parameters are those of `cloth` and `elevation`.
    """
    base = world_xyz_m.min(axis=0)
    low = lowest(world_xyz_m, cell_m=cell_m)
    ground = low[
        cloth(
            world_xyz_m[low] - base,
            cloth_m=cloth_m,
            rigidness=rigidness,
            threshold_m=threshold_m,
            where=where,
        )
    ]
    extent = np.stack([base, world_xyz_m.max(axis=0)])[:, :2]
    first = elevation(world_xyz_m[ground], extent, pixel_m=pixel_m, crs=crs)
    near = np.flatnonzero(np.abs(heights(world_xyz_m, first)) <= threshold_m)
    return elevation(world_xyz_m[near], extent, pixel_m=pixel_m, crs=crs), near
