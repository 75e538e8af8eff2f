"""Signals of a scan's own shots, fired once more: do reconstructions let through what was seen?"""

import math
from collections.abc import Mapping

import numpy as np
import xarray as xr

from dapple.formats import shots as shot_files
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.virtual import rescan, rescan_scores
from dapple.virtual.rescan import Crown
from dapple.virtual.scanner_model import Scanner
from dapple.virtual.scanner_window import through_box

MOST_SHOTS = rescan.CHUNK_SHOTS // 2
"""Shots through the crown that are fired once more: whole patches of them."""


def gap_error(
    meshes: Mapping[str, Mesh],
    voxels: xr.Dataset | None,
    fired: Shots,
    crown: Crown,
    scanner: Scanner,
    *,
    seed: int,
) -> float:
    """Root mean square error of the share of shots that pass, over patches of a degree.

    The shots are among those that the reconstruction was made of: it is no forecast, and a
    reconstruction of few positions does well. What is wrong here is wrong everywhere.

    Parameters
    ----------
    meshes, voxels, crown, scanner
        As in `rescan.first_ranges`.
    fired : Shots
        As from `some_patches`.
    seed : int

    Returns
    -------
    float
        NaN where no patch has enough shots.
    """
    if not len(fired):
        return math.nan
    predicted = rescan.first_ranges(dict(meshes), voxels, [fired], crown, scanner, seed=seed)
    rows = rescan_scores.compared(predicted, crown, math.inf)
    return rescan_scores.gap_rmse(rows)


def some_patches(shots: Shots, crown: Crown, rng: np.random.Generator) -> Shots:
    """Shots through the box of the plant, all of them in patches of a degree that chance chose."""
    enter_m, leave_m = through_box(shots.origin_m, shots.direction, crown.low_m, crown.high_m)
    meets = np.flatnonzero(leave_m > enter_m)
    x, y, z = shots.direction[meets].T
    zenith_deg = np.degrees(np.arccos(np.clip(z, -1, 1)))
    azimuth_deg = np.degrees(np.arctan2(x, y)) % 360
    row, column = rescan_scores.patches_of(zenith_deg, azimuth_deg)
    name = (shots.scan[meets].astype(np.int64) * 1000 + row) * 1000 + column
    _, patch, size = np.unique(name, return_inverse=True, return_counts=True)
    order = rng.permutation(len(size))
    fits = np.zeros(len(size), bool)
    fits[order] = np.cumsum(size[order]) <= MOST_SHOTS
    chosen = np.zeros(len(shots), bool)
    chosen[meets[fits[patch]]] = True
    return shot_files.select(shots, chosen)
