"""Polygons from classified points."""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Literal

from annotated_types import Ge, Le

from dapple.config.base import FREY, NotNegative, Positive, Section, key


class Polygons(Section):
    """One planar polygon per voxel and class."""

    voxel_size_m: Positive | Literal["auto"] = key(
        0.05, "edge of the voxels; auto: by the distance of the points and the size of leaves", FREY
    )
    leaf_size_m: Positive = key(
        0.05, "width of a leaf: voxel_size_m: auto takes one to two of them", FREY
    )
    buffer_m: NotNegative = key(
        round(sqrt(2 * 0.01**2) / 2, 6),
        "outward growth of each hull; voxel_size_m: auto takes 0.7 distances of the points",
        FREY,
    )
    mitre_limit: Annotated[float, Ge(1), Le(10)] = key(
        1.414, "corners move outwards by at most so many buffers"
    )

    @property
    def nominal_m(self) -> float:
        """Edge of the voxels before the points are known [m]."""
        return self.leaf_size_m if self.voxel_size_m == "auto" else self.voxel_size_m
