"""Observed images on the grid of the simulated ones, and maps of what networks make of them."""

from collections.abc import Sequence

import numpy as np

from dapple.errors import InputError
from dapple.formats.rasters import Raster
from dapple.retrieval import intervals, network

# A hair of a pixel, so that rounding does not add a row.
_HAIR = 1e-6
MAP_BANDS = ("lcc_ug_cm2", "low_ug_cm2", "high_ug_cm2", "spread_ug_cm2", "outside")


def shape_of(raster: Raster, pixel_m: float) -> tuple[int, int]:
    """Rows and columns of pixels of another size that cover a raster from its corner."""
    _, rows, columns = raster.values.shape
    size = raster.pixel_m / pixel_m
    return int(np.ceil(rows * size - _HAIR)), int(np.ceil(columns * size - _HAIR))


def resample(
    raster: Raster, *, left_m: float, top_m: float, pixel_m: float, shape: tuple[int, int]
) -> np.ndarray:
    """Average a raster over other pixels, weighted by area.

    Parameters
    ----------
    raster : Raster
        What was observed.
    left_m, top_m, pixel_m, shape
        The other pixels: outer north-west corner in world coordinates and edge [m], rows and
        columns.

    Returns
    -------
    (b, rows, columns) float32
        Mean of the data under each pixel; NaN where less than half of it has data.
    """
    down = _overlap(raster.top_m - top_m, raster.pixel_m, raster.values.shape[1], pixel_m, shape[0])
    across = _overlap(
        left_m - raster.left_m, raster.pixel_m, raster.values.shape[2], pixel_m, shape[1]
    )
    known = np.isfinite(raster.values)
    sums, weight = (
        np.stack([(down @ (across @ band.T).T) for band in bands])
        for bands in (np.where(known, raster.values, 0.0), known.astype(float))
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(weight >= 0.5, sums / weight, np.nan).astype(np.float32)


def _overlap(start_m: float, from_m: float, n_from: int, to_m: float, n_to: int):
    """Sparse (n_to, n_from) shares of each new pixel that lie in each old one, along one axis.

    `start_m` is how far the new axis starts after the old one.
    """
    from scipy.sparse import csr_matrix

    edges = np.union1d(np.arange(n_from + 1) * from_m, start_m + np.arange(n_to + 1) * to_m)
    middle, length = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    old = np.floor(middle / from_m).astype(np.int64)
    new = np.floor((middle - start_m) / to_m).astype(np.int64)
    both = (old >= 0) & (old < n_from) & (new >= 0) & (new < n_to)
    return csr_matrix((length[both] / to_m, (new[both], old[both])), shape=(n_to, n_from))


def sample(
    raster: Raster, *, left_m: float, top_m: float, pixel_m: float, shape: tuple[int, int]
) -> np.ndarray:
    """Value (b, rows, columns) of a raster at the centres of other pixels; NaN beyond it."""
    y = top_m - (np.arange(shape[0]) + 0.5) * pixel_m
    x = left_m + (np.arange(shape[1]) + 0.5) * pixel_m
    row = np.floor((raster.top_m - y) / raster.pixel_m).astype(np.int64)
    column = np.floor((x - raster.left_m) / raster.pixel_m).astype(np.int64)
    _, rows, columns = raster.values.shape
    there = ((row >= 0) & (row < rows))[:, None] & ((column >= 0) & (column < columns))
    values = raster.values[:, row.clip(0, rows - 1)][:, :, column.clip(0, columns - 1)]
    return np.where(there, values, np.nan)


def canopy(
    height_m: np.ndarray, *, min_height_m: float, where: str = "canopy height"
) -> np.ndarray:
    """Pixels (rows, columns) whose vegetation is at least so high; unknown heights are not.

    Raises
    ------
    InputError
        There is none.
    """
    mask = np.nan_to_num(height_m, nan=-1.0) >= min_height_m
    if not mask.any():
        raise InputError(
            where, f"no pixel of {min_height_m:g} m or more", "canopy under the images",
            "Check that LiDAR and images show one place, or lower the height.",
        )  # fmt: skip
    return mask


def ensemble(
    networks: Sequence[network.Network], features: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation (n,) over networks of what they predict from bands (n, b)."""
    each = np.array([network.predict(one, features) for one in networks])
    return each.mean(axis=0), each.std(axis=0)


def retrieve(
    networks: Sequence[network.Network],
    interval: intervals.Interval,
    taught: intervals.TrainingRange,
    bands: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Map chlorophyll with its interval.

    Parameters
    ----------
    networks, interval, taught
        Trained on one kind of pixels.
    bands : (b, rows, columns) float
        Means of such pixels in observed cells, NaN where there are none.

    Returns
    -------
    layers : (5, rows, columns) float32
        `MAP_BANDS`: mean, ends of the interval and spread of the networks [µg cm⁻²], and 1 where
        the bands lie beyond those that taught; NaN without data.
    each : (k, rows, columns) float32
        What each network predicts [µg cm⁻²].
    """
    flat = bands.reshape(len(bands), -1).T
    each = np.array([network.predict(one, flat) for one in networks])
    mean, spread = each.mean(axis=0), each.std(axis=0)
    low, high = intervals.bounds(interval, mean, spread)
    layers = np.array([mean, low, high, spread, intervals.outside(taught, flat), *each], np.float32)
    layers[:, ~np.isfinite(flat).all(axis=1)] = np.nan
    layers = layers.reshape(-1, *bands.shape[1:])
    return layers[: len(MAP_BANDS)], layers[len(MAP_BANDS) :]
