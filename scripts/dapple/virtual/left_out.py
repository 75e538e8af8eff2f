"""What the other positions of a scan show when some are left out."""

from collections.abc import Iterable

import numpy as np

from dapple.cloud.clean import thin
from dapple.formats.clouds import LEAF, WOOD, Cloud
from dapple.formats.shots import Shots
from dapple.structure import traversal
from dapple.structure.returns import kinds_by_place


def seen_from(
    chunks: Iterable[Shots],
    classified: Cloud,
    *,
    majority_voxel_m: float,
    max_deviation: float,
    thin_voxel_m: float,
) -> Cloud:
    """Points that some shots make, with classes known from all.

    Parameters
    ----------
    chunks : iterable of Shots
        Of some positions.
    classified : Cloud
        Of all positions: a return is what most points around it are, and noise where none are.
    majority_voxel_m : float
        Edge of the voxels in which the majority decides [m].
    max_deviation : float
        Returns at or above are left out, as in the filter of noise.
    thin_voxel_m : float
        One point is left in a voxel of this size [m].
    """
    kinds = classified.attributes["Classification"]
    kinds_of = kinds_by_place(classified.xyz_m, kinds, voxel_size_m=majority_voxel_m, beside=False)
    parts, classes = [], []
    for chunk in chunks:
        kind = kinds_of(chunk)
        kept = (kind != traversal.NOISE) & ~(chunk.deviation >= max_deviation)
        parts.append(chunk.return_xyz_m[kept])
        classes.append(np.where(kind[kept] == traversal.HIT, LEAF, WOOD).astype(np.uint8))
    cloud = Cloud(
        np.concatenate(parts), classified.origin_m, {"Classification": np.concatenate(classes)}
    )
    return thin(cloud, thin_voxel_m)
