"""How much of a stand a scan leaves in shadow.

Van der Zande et al. (2008) call relative shadow the share of the truly filled voxels that have no
return: those that beams only passed count as shadow too. What no beam reached is less.
"""

import numpy as np

from dapple.errors import InputError
from dapple.survey.voxel_status import HIT, UNSEEN


def in_cells(voxels: np.ndarray, per_edge: int, reduce: str = "mean") -> np.ndarray:
    """Mean or sum of voxels over cells of `per_edge` voxels along each edge."""
    if any(count % per_edge for count in voxels.shape):
        raise InputError(
            "survey.cell_size_m",
            f"cells of {per_edge} voxels in a grid of {voxels.shape}",
            "a size that divides every edge",
            "Choose cells and volume so that one divides the other.",
        )
    nx, ny, nz = (count // per_edge for count in voxels.shape)
    blocks = voxels.reshape(nx, per_edge, ny, per_edge, nz, per_edge)
    return getattr(blocks, reduce)(axis=(1, 3, 5))


def relative_shadow(attribute: np.ndarray, filled: np.ndarray) -> dict[str, float]:
    """Shares of the truly filled voxels that a scan did not see.

    Parameters
    ----------
    attribute : (nx, ny, nz) uint8
        From `reach.attribute`.
    filled : (nx, ny, nz) bool
        Voxels that hold some leaf or wood.

    Returns
    -------
    dict
        `rs`, relative shadow: filled voxels without a return, passed by beams or not;
        `unreached`, filled voxels that no beam hit or passed; `false_hits`, the share of returns'
        voxels that hold nothing.
    """
    of_filled = attribute[filled]
    if not len(of_filled):
        raise InputError("survey.stands", "no filled voxel", "a stand", "It holds nothing to see.")
    hit = attribute == HIT
    return {
        "rs": float((of_filled != HIT).mean()),
        "unreached": float((of_filled == UNSEEN).mean()),
        "false_hits": float((~filled[hit]).mean()) if hit.any() else 0.0,
    }


def filled_profile(attribute: np.ndarray, filled: np.ndarray) -> dict[str, np.ndarray]:
    """Number of filled voxels in every layer: truly, hit, and hit or passed though filled."""
    return {
        "true": filled.sum(axis=(0, 1)),
        "hit": (attribute == HIT).sum(axis=(0, 1)),
        "reached": (filled & (attribute != UNSEEN)).sum(axis=(0, 1)),
    }


def shadow_map(
    attribute: np.ndarray, filled: np.ndarray, per_edge: int, bottom: int, top: int
) -> np.ndarray:
    """Relative shadow of columns of `per_edge` voxels between two layers; NaN without foliage."""
    layer = slice(bottom, top)
    nx, ny = (count // per_edge for count in filled.shape[:2])
    shape = (nx, per_edge, ny, per_edge, -1)
    n_filled = filled[:, :, layer].reshape(shape).sum(axis=(1, 3, 4))
    shadowed = (filled & (attribute != HIT))[:, :, layer].reshape(shape).sum(axis=(1, 3, 4))
    with np.errstate(invalid="ignore"):
        return np.where(n_filled > 0, shadowed / n_filled, np.nan)
