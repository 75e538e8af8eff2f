"""Crowns in a canopy height model, and their division into sub-crowns and height layers."""

import numpy as np
from scipy import ndimage
from skimage.feature import peak_local_max
from skimage.segmentation import watershed
from sklearn.cluster import KMeans
from threadpoolctl import threadpool_limits

from dapple.errors import InputError
from dapple.streams import stream_seed


def crowns(
    height_m: np.ndarray,
    *,
    pixel_m: float,
    min_height_m: float,
    smoothing_m: float,
    min_distance_m: float,
    min_area_m2: float,
) -> np.ndarray:
    """Divide a canopy height model into crowns by a watershed on its smoothed surface.

    Every local maximum floods its surroundings downhill until crowns meet. What floods less than
    `min_area_m2` is given to its neighbours, or left out where it stands alone.

    Parameters
    ----------
    height_m : (rows, columns) float
        Height of the canopy; NaN where it is not known [m].
    pixel_m : float
    min_height_m : float
        Lower canopy belongs to no crown [m].
    smoothing_m : float
        Standard deviation of the Gaussian that smooths the surface [m].
    min_distance_m : float
        Tree tops are at least this far apart [m].
    min_area_m2 : float
        Least area of a crown [m²].

    Returns
    -------
    (rows, columns) int32
        Number of the crown, from 1; 0: no crown. Numbers ascend from the north-west.

    Raises
    ------
    InputError
        Nothing reaches `min_height_m`.
    """
    known = np.isfinite(height_m)
    filled = np.where(known, height_m, 0.0)
    canopy = known & (filled >= min_height_m)
    if not canopy.any():
        raise InputError(
            "canopy",
            f"heights up to {filled.max(initial=0):.1f} m",
            f"trees of at least {min_height_m} m (chlorophyll.crowns.min_height_m)",
            "Lower chlorophyll.crowns.min_height_m, or check that the cloud's heights are metres.",
        )
    smooth = ndimage.gaussian_filter(filled, smoothing_m / pixel_m)
    tops = peak_local_max(
        smooth,
        min_distance=max(1, round(min_distance_m / pixel_m)),
        threshold_abs=min_height_m / 2,
        labels=canopy.astype(np.int32),
        exclude_border=False,
    )
    tops = tops[np.lexsort(tops.T[::-1])]
    least = min_area_m2 / pixel_m**2
    labels = _flood(smooth, tops, canopy)
    large = np.bincount(labels.ravel(), minlength=len(tops) + 1)[1:] >= least
    labels = _flood(smooth, tops[large], canopy)
    return np.where(canopy, labels, 0).astype(np.int32)


def _flood(smooth: np.ndarray, tops: np.ndarray, canopy: np.ndarray) -> np.ndarray:
    markers = np.zeros(smooth.shape, np.int32)
    markers[tuple(tops.T)] = np.arange(1, len(tops) + 1)
    return watershed(-smooth, markers, mask=canopy)


def sub_crowns(
    labels: np.ndarray, *, pixel_m: float, area_m2: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Cut every crown into compact sub-crowns of about equal area by k-means on its pixels.

    Parameters
    ----------
    labels : (rows, columns) int32
        Crowns, from 1.
    pixel_m : float
    area_m2 : float
        Wanted area; a crown gets as many sub-crowns as come nearest to it, at least one [m²].
    seed : int
        Of the first centres.

    Returns
    -------
    sub : (rows, columns) int32
        Number of the sub-crown, from 1, ascending with the crowns; 0: none.
    crown : (s,) int32
        The crown of each sub-crown.
    """
    sub = np.zeros_like(labels)
    crown: list[int] = []
    places = ndimage.find_objects(labels)
    # One thread: crowns are small, and the sums' order has to be the same everywhere.
    with threadpool_limits(1):
        for number, box in enumerate(places, start=1):
            if box is None:
                continue
            inside = labels[box] == number
            pixels = np.argwhere(inside)
            k = min(max(1, round(len(pixels) * pixel_m**2 / area_m2)), len(pixels))
            means = KMeans(k, n_init=1, random_state=stream_seed(seed, number))
            cluster = means.fit_predict(pixels) if k > 1 else np.zeros(len(pixels), np.int32)
            _, cluster = np.unique(cluster, return_inverse=True)
            sub[box][inside] = cluster + len(crown) + 1
            crown += [number] * (int(cluster.max()) + 1)
    return sub, np.array(crown, np.int32)


def layer_limits(
    height_m: np.ndarray, crown: np.ndarray, *, n_layers: int, base_share: float
) -> np.ndarray:
    """Heights between the layers of every crown, which have equal depth.

    Parameters
    ----------
    height_m : (n,) float64
        Heights of the crowns' points above the ground [m].
    crown : (n,) int
        Their crown, from 1; 0 is left out.
    n_layers : int
    base_share : float
        Share of a crown's points that lie below its base: stems and shrubs.

    Returns
    -------
    (n_crowns, n_layers - 1) float64
        NaN for crowns without points. The first and the last layer are open below and above.
    """
    n_crowns = int(crown.max(initial=0))
    order = np.lexsort((height_m, crown))
    counts = np.bincount(crown, minlength=n_crowns + 1)
    first = np.cumsum(counts) - counts
    ordered = height_m[order]
    limits = np.full((n_crowns, n_layers - 1), np.nan)
    there = np.flatnonzero(counts[1:]) + 1
    base = ordered[first[there] + np.floor(base_share * (counts[there] - 1)).astype(int)]
    top = ordered[first[there] + counts[there] - 1]
    steps = np.arange(1, n_layers) / n_layers
    limits[there - 1] = base[:, None] + (top - base)[:, None] * steps
    return limits


def layer_of(height_m: np.ndarray, crown: np.ndarray, limits_m: np.ndarray) -> np.ndarray:
    """(n,) layer of points from 0 (lowest), by the limits of their crowns (numbers from 1)."""
    return (height_m[:, None] >= limits_m[crown - 1]).sum(axis=1).astype(np.int32)


def outlines(labels: np.ndarray) -> np.ndarray:
    """(rows, columns) bool: pixels of a crown that touch another crown or none."""
    edge = np.zeros(labels.shape, bool)
    for axis in (0, 1):
        for step in (1, -1):
            other = np.roll(labels, step, axis)
            differs = other != labels
            # Rolling wraps round: the border of the map is no outline.
            border: list[slice | int] = [slice(None), slice(None)]
            border[axis] = 0 if step == 1 else -1
            differs[tuple(border)] = False
            edge |= differs
    return edge & (labels > 0)
