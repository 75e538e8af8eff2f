"""Polygons from classified points."""

from __future__ import annotations

from math import sqrt
from typing import Annotated

from annotated_types import Ge, Le

from dapple.config.base import FREY, NotNegative, Positive, Section, key


class Polygons(Section):
    """One planar polygon per voxel and class."""

    voxel_size_m: Positive = key(0.05, "edge of the voxels", FREY)
    buffer_m: NotNegative = key(
        round(sqrt(2 * 0.01**2) / 2, 6), "outward growth of each hull", FREY
    )
    mitre_limit: Annotated[float, Ge(1), Le(10)] = key(
        1.414, "corners move outwards by at most so many buffers"
    )
