"""Stems in a cloud of a plot: upright columns of points that reach the ground."""

from itertools import pairwise

import numpy as np
import pandas as pd
from scipy import ndimage

from dapple.formats.ground_surface import GroundSurface

CELL_M = 0.05
SLICE_M = (0.5, 2.0)
"""Heights above the ground between which stems stand free of crowns."""
SLICE_SHARE = (0.12, 0.45)
"""The same as shares of the plot's height, for trees so low that they come first."""
LAYER_M = 0.1
FILLED = 0.6
"""Share of the layers of the slice in which a stem has points."""
WIDEST_M = 1.6
MOST_CELLS = 20_000_000
JOIN_M = 0.3
"""Pieces of one stem, seen from two sides, lie no farther apart."""
LEAST_HEIGHT_M = 1.0
AXIS_M = 1.0
"""Within it of a stem, the highest point is the height of the tree."""
COLUMNS = ("id", "x_m", "y_m", "z_m", "width_m", "height_m", "points")


def find(xyz_m: np.ndarray, ground: GroundSurface) -> pd.DataFrame:
    """Find stems.

    Points of a slice above the ground are sorted into columns of 5 cm; columns that touch and that
    are filled through most of the slice's height are a stem.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Local frame [m].
    ground : GroundSurface

    Returns
    -------
    pandas.DataFrame
        `id` from 1, from west to east; `x_m`, `y_m`, `z_m` of the foot (local frame); `width_m` of
        the columns; `height_m` of the highest point within a metre of the stem's axis; `points` of
        the slice.
    """
    above = xyz_m[:, 2] - ground.height_m(xyz_m[:, :2])
    top = float(np.quantile(above, 0.999)) if len(above) else 0.0
    low, high = (min(m, share * top) for m, share in zip(SLICE_M, SLICE_SHARE, strict=True))
    inside = np.flatnonzero((above >= low) & (above < high))
    if top < LEAST_HEIGHT_M or not len(inside):
        return pd.DataFrame({name: [] for name in COLUMNS})
    plan, layer = xyz_m[inside, :2], ((above[inside] - low) / LAYER_M).astype(np.int64)
    base = plan.min(axis=0) - CELL_M
    cell = CELL_M * max(1.0, np.sqrt(np.prod(np.ptp(plan, axis=0) / CELL_M + 3) / MOST_CELLS))
    at = ((plan - base) / cell).astype(np.int64)
    shape = tuple(at.max(axis=0) + 2)
    n_layers = max(1, int(np.ceil((high - low) / LAYER_M)))
    number = _columns(at, layer, shape, n_layers, cell)
    return _table(plan, layer, number[tuple(at.T)], n_layers, xyz_m, above, ground)


def _columns(
    at: np.ndarray, layer: np.ndarray, shape: tuple[int, int], n_layers: int, cell_m: float
) -> np.ndarray:
    """Number of the stem of every cell, 0 for none."""
    reach = max(1, round(0.1 / cell_m))
    filled = np.zeros(shape, np.int32)
    for one in range(n_layers):
        there = np.zeros(shape, bool)
        there[tuple(at[layer == one].T)] = True
        # A stem leans and is seen in parts: a layer counts for the cells beside it too.
        filled += ndimage.binary_dilation(there, iterations=reach)
    upright = filled >= FILLED * n_layers
    joined = ndimage.binary_dilation(upright, iterations=max(1, round(JOIN_M / 2 / cell_m)))
    number, _ = ndimage.label(joined, np.ones((3, 3)))
    return np.where(upright, number, 0)


def _table(plan, layer, number, n_layers: int, xyz_m, above, ground) -> pd.DataFrame:
    rows = []
    order = np.argsort(number, kind="stable")
    starts = np.searchsorted(number[order], np.arange(1, number.max() + 2))
    by_east = np.argsort(xyz_m[:, 0], kind="stable")
    east = xyz_m[by_east, 0]
    for begin, end in pairwise(starts):
        own = order[begin:end]
        if len(np.unique(layer[own])) < FILLED * n_layers:
            continue
        low, high = np.quantile(plan[own], [0.02, 0.98], axis=0)
        width = float((high - low).max())
        if width > WIDEST_M:
            continue
        place = 0.5 * (low + high)
        near = by_east[slice(*np.searchsorted(east, place[0] + np.array([-AXIS_M, AXIS_M])))]
        near = near[np.abs(xyz_m[near, 1] - place[1]) < AXIS_M]
        rows.append((*place, width, float(above[near].max()), len(own)))
    rows.sort()
    found = pd.DataFrame(rows, columns=["x_m", "y_m", "width_m", "height_m", "points"])
    found["z_m"] = ground.height_m(found[["x_m", "y_m"]].to_numpy(float).reshape(-1, 2))
    found["id"] = np.arange(1, len(found) + 1)
    tall = found["height_m"] >= LEAST_HEIGHT_M
    found = found[tall].reset_index(drop=True)
    found["id"] = np.arange(1, len(found) + 1)
    return found[list(COLUMNS)]
