"""Plant area of voxels, height layers and the whole crown, with intervals that say how sure it is.

What is not known of an area comes from four places: beams are few; elements are finite, and lie
and turn by chance; beams do not reach all of a crown; and what a grid of voxels cannot tell, which
is the same share everywhere. Constants below were chosen on virtual crowns (`benchmarks/
plant_area.py`), those that coverage is reported on are others.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree
from scipy.stats import gamma

from dapple.structure import occlusion
from dapple.structure.voxel_data import CAPPED, DENSITY

LEVEL = 0.95
"""Of the intervals."""
OF_BEAMS = 1.15
"""Variance over that of the beams' number alone."""
OF_PLACES, OF_TURNS = 0.04, 0.3
"""Variance by chance of where elements lie, and of how they turn to a single scan position, over
area times an element's area."""
HIDDEN = 0.088
"""Share of a voxel's area that its leaves hide where they fill it in part, over area per face."""
LARGE, UNTOLD, LARGEST = 0.167, 0.15, 0.5
"""Share by which leaves that are large in voxels raise the area, over a leaf's area per face; by
how much more where the estimator was not told the area of a leaf; and the largest area per face."""
BEHIND, OF_BEHIND = 1.5, 1.5
"""Share of filled voxels' area that a single scan position loses besides, behind leaves, and its
standard deviation; of n positions, the nth part."""
OF_CROWN, OF_LAYER = 0.02, 0.05
"""Standard deviation between crowns, and between their layers, of the share that is hidden.

Chosen by hand from the table that `benchmarks/plant_area.py learn` makes, so that of the crowns
learnt on, those scanned densely have `LEVEL` of their areas in the interval, to a per cent, in
every group by number of positions. With voxels of 0.1 m two groups do not: crowns of one position
(8 of 9) and of few shots (42 of 49).
"""
OF_FILL = 0.3
"""Correlation of the errors of voxels that were filled."""
NEIGHBOURS = 16
"""Known voxels that an unknown one is filled from."""


@dataclass(frozen=True)
class PlantArea:
    """Plant area of every voxel.

    Attributes
    ----------
    area_m2 : (nx, ny, nz) float64
        One-sided, estimated or filled from the neighbours; 0 outside of the crown.
    variance_m4 : (nx, ny, nz) float64
    hidden_m2 : (nx, ny, nz) float64
        What voxels like this one hide on average from the estimator; below 0 where leaves are
        large in voxels.
    is_filled : (nx, ny, nz) bool
        Unknown to the scan, and filled from neighbours.
    height_m : (nz,) float64
        Of the layers' middles, local frame [m].
    scans : int
        Number of scan positions.
    """

    area_m2: np.ndarray
    variance_m4: np.ndarray
    hidden_m2: np.ndarray
    is_filled: np.ndarray
    height_m: np.ndarray
    scans: int


def of_voxels(voxels: xr.Dataset, *, element_area_m2: float, fill_range_m: float) -> PlantArea:
    """Plant area of every voxel and its variance.

    Parameters
    ----------
    voxels : xarray.Dataset
        As `voxels.estimate` gives it, by free paths.
    element_area_m2 : float
        One-sided area of an element, a leaf or needle [m²].
    fill_range_m : float
        Unknown voxels within the crown's hull take the mean of the nearest known ones, weighted by
        exp(-distance/range) [m].

    Notes
    -----
    Variance of a known voxel: that of the number of beams (`estimators.free_path`), and c·s·A for
    elements of area s: A/s elements are there by chance, and a beam's direction sees each at an
    angle of chance (for spherical angles, s·A/3 from one direction and less from several). A voxel
    at the cap may hold any more: its variance holds the distance to twice the cap. Variance of a
    filled one: that of its neighbours' areas among each other, and of their mean.

    Beams that cross the empty part of a voxel count as if leaves had been there to meet: the more
    leaves the other part holds, the more of them is hidden. Parts of one leaf do not hide each
    other, so that leaves which are large in voxels come out too large.
    """
    data = voxels.transpose("x", "y", "z")
    size_m = float(data.attrs["voxel_size_m"])
    volume_m3 = size_m**3
    density = data[DENSITY].to_numpy().astype(np.float64)
    known = np.isfinite(density)
    area_m2 = np.where(known, density, 0.0) * volume_m3
    by_beams_m2 = np.nan_to_num(data["standard_error_m2_m3"].to_numpy(), nan=0.0) * volume_m3
    variance_m4 = OF_BEAMS * by_beams_m2**2
    scans = max(int(data.attrs.get("total_scans", 1)), 1)
    of_elements = OF_PLACES + OF_TURNS / scans
    variance_m4 += of_elements * element_area_m2 * np.maximum(area_m2, by_beams_m2)
    variance_m4 += np.where((data["flag"].to_numpy() & CAPPED) > 0, area_m2**2, 0.0)
    # What no beam hit far from any leaf is air.
    is_air = known & (area_m2 == 0) & ~binary_dilation(area_m2 > 0, np.ones((3, 3, 3)))
    variance_m4[is_air] = 0.0
    is_filled = occlusion.in_crown(density) & ~known
    if is_filled.any():
        filled = np.argwhere(is_filled)
        donors = np.argwhere(known)
        k = min(NEIGHBOURS, len(donors))
        away, near = cKDTree(donors).query(filled, k)
        weight = np.exp(-away.reshape(-1, k) * size_m / fill_range_m)
        weight /= weight.sum(axis=1, keepdims=True)
        at = tuple(donors[near.reshape(-1, k)].transpose(2, 0, 1))
        mean_m2 = (weight * area_m2[at]).sum(axis=1)
        spread_m4 = (weight * (area_m2[at] - mean_m2[:, None]) ** 2).sum(axis=1)
        own_m4 = (weight**2 * variance_m4[at]).sum(axis=1)
        area_m2[tuple(filled.T)] = mean_m2
        variance_m4[tuple(filled.T)] = spread_m4 * (1 + (weight**2).sum(axis=1)) + own_m4
    variance_m4[~known & ~is_filled] = 0.0
    is_told = float(data.attrs.get("single_leaf_area_m2", 0.0)) > 0
    of_leaves = LARGE if is_told else LARGE + UNTOLD
    of_leaves *= min(element_area_m2 / size_m**2, LARGEST)
    hidden_m2 = area_m2 * (HIDDEN * area_m2 / size_m**2 - of_leaves)
    hidden_m2[is_filled] = BEHIND / scans * area_m2[is_filled]
    height_m = data["z"].to_numpy().astype(np.float64)
    return PlantArea(area_m2, variance_m4, hidden_m2, is_filled, height_m, scans)


def interval_m2(area_m2: np.ndarray, variance_m4: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds between which the true area lies in `LEVEL` of cases, by a gamma distribution.

    Where no beam hit a leaf, the lower bound is 0.
    """
    area_m2, variance_m4 = np.asarray(area_m2, np.float64), np.asarray(variance_m4, np.float64)
    error_m2 = np.sqrt(variance_m4)
    mean_m2 = np.where(area_m2 > 0, area_m2, error_m2)
    with np.errstate(divide="ignore", invalid="ignore"):
        shape, scale = mean_m2**2 / variance_m4, variance_m4 / mean_m2
        low, high = (gamma.ppf(0.5 * (1 + sign * LEVEL), shape, scale=scale) for sign in (-1, 1))
    sure = variance_m4 <= 0
    low = np.where(sure, area_m2, np.where(area_m2 > 0, np.nan_to_num(low), 0.0))
    return low, np.where(sure, area_m2, high)


def as_dataset(found: PlantArea, voxels: xr.Dataset) -> xr.Dataset:
    """Area of every voxel, its bounds, and which voxels were filled, on the grid of `voxels`."""
    low_m2, high_m2 = interval_m2(found.area_m2, found.variance_m4)
    told = {
        "plant_area_m2": (found.area_m2, "one-sided plant area"),
        "plant_area_low_m2": (low_m2, f"lower bound of {LEVEL:.0%}"),
        "plant_area_high_m2": (high_m2, f"upper bound of {LEVEL:.0%}"),
    }
    data = {
        name: (tuple("xyz"), values, {"long_name": text, "units": "m2"})
        for name, (values, text) in told.items()
    }
    is_filled = found.is_filled.astype(np.uint8)
    data["filled"] = (
        tuple("xyz"),
        is_filled,
        {"long_name": "1: filled from neighbours", "units": "1"},
    )
    attrs = {name: voxels.attrs[name] for name in ("voxel_size_m", "corner_m", "origin_m")}
    return xr.Dataset(data, {axis: voxels[axis] for axis in "xyz"}, attrs)


def by_part(
    found: PlantArea, *, of_crown: float = OF_CROWN, of_layer: float = OF_LAYER
) -> pd.DataFrame:
    """Plant area of every height layer and of the crown, with intervals.

    Parameters
    ----------
    found : PlantArea
    of_crown, of_layer : float
        Standard deviation between crowns, and between their layers, of the share that is hidden.

    Returns
    -------
    pandas.DataFrame
        `part` (`crown`, `layer`), `height_m` (middle of the layer, NaN for the crown),
        `plant_area_m2` as estimated, `likely_m2` with what crowns like this one hide, `low_m2`,
        `high_m2`, `filled_share` (of the area, what was filled).
    """
    rows = [{"part": "crown", "height_m": np.nan} | _summed(found, slice(None), of_crown)]
    for k, height_m in enumerate(found.height_m.tolist()):
        one = _summed(found, slice(k, k + 1), of_layer)
        rows.append({"part": "layer", "height_m": height_m} | one)
    return pd.DataFrame(rows)


def _summed(found: PlantArea, layers: slice, of_model: float) -> dict[str, float]:
    area_m2, variance_m4, hidden_m2, is_filled = (
        one[:, :, layers]
        for one in (found.area_m2, found.variance_m4, found.hidden_m2, found.is_filled)
    )
    total_m2, filled_m2 = float(area_m2.sum()), float(area_m2[is_filled].sum())
    together_m4 = np.sqrt(variance_m4[is_filled]).sum() ** 2
    apart_m4 = (1 - OF_FILL) * variance_m4[is_filled].sum() + OF_FILL * together_m4
    of_all = (of_model * total_m2) ** 2 + (OF_BEHIND / found.scans * filled_m2) ** 2
    variance = variance_m4[~is_filled].sum() + apart_m4 + of_all
    likely_m2 = total_m2 + float(hidden_m2.sum())
    low, high = interval_m2(np.array(likely_m2), np.array(variance))
    return {
        "plant_area_m2": total_m2,
        "likely_m2": float(likely_m2),
        "low_m2": float(low),
        "high_m2": float(high),
        "filled_share": filled_m2 / total_m2 if total_m2 > 0 else 0.0,
    }
