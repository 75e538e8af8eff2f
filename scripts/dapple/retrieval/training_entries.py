"""From images to entries: sunlit or all canopy pixels, averaged over cells of a few metres."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numba
import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.progress import followed

MASKS = ("sunlit", "all")

Chunks = Iterable[tuple[slice, np.ndarray]]
"""Pixels in row-major order, and their reflectance (pixels, images, bands), part by part."""


@dataclass(frozen=True)
class Cells:
    """Cells of a few metres over an image, from its north-west corner.

    Attributes
    ----------
    of_pixel : (pixels,) int64
        Cell of every pixel, both in row-major order. A pixel belongs to the cell of its centre.
    shape : (int, int)
        Rows and columns of cells; the last ones may be cut by the image.
    pixels_per_cell : float
        Of a whole cell.
    """

    of_pixel: np.ndarray
    shape: tuple[int, int]
    pixels_per_cell: float


def cells(shape: tuple[int, int], *, pixel_m: float, cell_m: float = 3.0) -> Cells:
    """Lay cells of `cell_m` over an image of `shape` (rows, columns) with pixels of `pixel_m`."""
    # A hair more than the centre: rounding must not shift a pixel that starts on an edge.
    row, column = (
        np.floor((np.arange(n) + 0.5) * pixel_m / cell_m + 1e-9).astype(np.int64) for n in shape
    )
    across = int(column[-1]) + 1
    of_pixel = (row[:, None] * across + column).ravel()
    return Cells(of_pixel, (int(row[-1]) + 1, across), (cell_m / pixel_m) ** 2)


def chunks_of(image: np.ndarray) -> Chunks:
    """One image (bands, rows, columns) as chunks."""
    flat = image.reshape(len(image), -1).T[:, None, :]
    return [(slice(0, len(flat)), flat)]


def select(
    image: np.ndarray, canopy: np.ndarray, *, mask: str, near_infrared: int, sunlit_nir: float
) -> np.ndarray:
    """Choose pixels of an image as `aggregate` does, to look at them.

    Parameters
    ----------
    image : (b, rows, columns) float
        Reflectance, NaN where there are no data.
    canopy : (rows, columns) bool
        Pixels that see the canopy.
    mask : {"sunlit", "all"}
        Canopy pixels whose near-infrared reflectance is above the threshold, or all of them.
    near_infrared : int
        Number of that band.
    sunlit_nir : float
        The threshold; 0.25 in Zhao et al. (2025).

    Returns
    -------
    (rows, columns) bool
        Only pixels with data in every band are chosen.
    """
    known = canopy & np.isfinite(image).all(axis=0)
    return known & (np.nan_to_num(image[near_infrared]) > _threshold(mask, sunlit_nir))


def aggregate(
    chunks: Chunks,
    canopy: np.ndarray,
    over: Cells,
    *,
    near_infrared: int,
    sunlit_nir: float,
    min_share: float,
    masks: tuple[str, ...] = MASKS,
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Average chosen pixels of images, observed or simulated, over cells.

    Parameters
    ----------
    chunks : Chunks
        Reflectance of n images, 0 to 1; NaN where there are no data.
    canopy : (rows, columns) bool
        Pixels that see the canopy.
    over : Cells
    near_infrared, sunlit_nir : int, float
        See `select`.
    min_share : float
        Chosen pixels that a cell must have, as a share of a whole cell.
    masks : tuple of {"sunlit", "all"}
        See `select`.

    Returns
    -------
    dict of str to (means, count)
        By mask: (n, b, rows, columns) float32 of cells, NaN where too few pixels are chosen, and
        (n, rows, columns) int32 chosen pixels.

    Raises
    ------
    InputError
        Another mask, or images and canopy of different size.
    """
    thresholds = np.array([_threshold(mask, sunlit_nir) for mask in masks])
    flat, n_cells = np.ascontiguousarray(canopy).ravel(), over.shape[0] * over.shape[1]
    sums = count = None
    done = 0
    each = followed(chunks, "pixels of all images", len(flat), size=lambda one: len(one[1]))
    for pixels, values in each:
        if sums is None:
            sums = np.zeros((len(masks), n_cells, *values.shape[1:]))
            count = np.zeros(sums.shape[:-1], np.int32)
        if pixels.start != done or pixels.stop > len(flat):
            break
        done = pixels.stop
        _add(values, flat[pixels], over.of_pixel[pixels], near_infrared, thresholds, sums, count)
    if sums is None or count is None or done != len(flat) or len(over.of_pixel) != len(flat):
        raise InputError(
            "images", f"{done} pixels", f"the {len(flat)} of the canopy mask, in their order",
            "Make images and canopy mask on one grid.",
        )  # fmt: skip
    enough = count >= max(1.0, min_share * over.pixels_per_cell)
    means = np.where(enough[..., None], sums / np.maximum(count, 1)[..., None], np.nan)
    n_images, n_bands = means.shape[2:]
    return {
        mask: (
            mean.transpose(1, 2, 0).reshape(n_images, n_bands, *over.shape).astype(np.float32),
            number.T.reshape(n_images, *over.shape),
        )
        for mask, mean, number in zip(masks, means, count, strict=True)
    }


def _threshold(mask: str, sunlit_nir: float) -> float:
    if mask not in MASKS:
        raise InputError("mask", f"{mask!r}", '"sunlit" or "all"', "Choose one of them.")
    return sunlit_nir if mask == "sunlit" else -np.inf


@numba.njit(cache=True)
def _add(values, canopy, cell, near_infrared, thresholds, sums, count):
    """Pixel after pixel in one order, so that sums are the same on every run."""
    n_pixels, n_images, n_bands = values.shape
    for p in range(n_pixels):
        if not canopy[p]:
            continue
        for k in range(n_images):
            known = True
            for b in range(n_bands):
                known &= np.isfinite(values[p, k, b])
            if not known:
                continue
            for m in range(len(thresholds)):
                if values[p, k, near_infrared] > thresholds[m]:
                    count[m, cell[p], k] += 1
                    for b in range(n_bands):
                        sums[m, cell[p], k, b] += values[p, k, b]


def entries(
    means: np.ndarray,
    count: np.ndarray,
    parameters: pd.DataFrame,
    bands: Sequence[str],
    *,
    max_entries: int | None = None,
    seed: int = 0,
    where: str = "training set",
) -> pd.DataFrame:
    """Rows to learn from, out of the cell means of simulated images.

    Parameters
    ----------
    means, count : (n, b, rows, columns) and (n, rows, columns)
        From `aggregate`.
    parameters : DataFrame
        Leaf and soil of the n images.
    bands : (b,) sequence of str
        Their names.
    max_entries : int or None
        Keep so many, drawn by chance.
    seed : int
        Of that draw.
    where : str
        Name of the set, for messages.

    Returns
    -------
    DataFrame
        One row per image and cell with a mean: the columns of `table` and all parameters
        (float32), in the order of image and cell.

    Raises
    ------
    InputError
        No cell has a mean, or there are not as many images as parameters.
    """
    if len(means) != len(parameters):
        raise InputError(
            where, f"{len(means)} images", f"{len(parameters)}, one per combination",
            "Make the images again.",
        )  # fmt: skip
    frame = table(means, count, bands)
    if frame.empty:
        raise InputError(
            where, "no cell with enough canopy pixels", "canopy in the images",
            "Check scene and canopy mask, or lower the least share of a cell.",
        )  # fmt: skip
    if max_entries is not None and len(frame) > max_entries:
        rng = np.random.default_rng(seed)
        kept = np.sort(rng.choice(len(frame), max_entries, replace=False))
        frame = frame.iloc[kept].reset_index(drop=True)
    of_entry = parameters.iloc[frame["combination"]].reset_index(drop=True)
    return pd.concat([frame, of_entry.astype(np.float32)], axis=1)


def table(means: np.ndarray, count: np.ndarray, bands: Sequence[str]) -> pd.DataFrame:
    """Cells that have a mean: bands (float32), `combination`, `row`, `column`, `pixels`."""
    k, row, column = np.nonzero(np.isfinite(means).all(axis=1))
    frame = pd.DataFrame(means[k, :, row, column], columns=list(bands))
    numbers = {"combination": k, "row": row, "column": column, "pixels": count[k, row, column]}
    for name, values in numbers.items():
        frame[name] = values.astype(np.int32)
    return frame


def features(frame: pd.DataFrame, bands: Sequence[str]) -> np.ndarray:
    """The bands of a table (n, b), float32."""
    return frame[list(bands)].to_numpy(np.float32)


def chlorophyll(frame: pd.DataFrame) -> np.ndarray:
    """What the bands of a table are to tell, (n,) float64 [µg cm⁻²]."""
    return frame["chlorophyll_ug_cm2"].to_numpy(float)
