"""Leaf or wood."""

from __future__ import annotations

from typing import Literal

from dapple.config.base import FREY, Positive, Section, key


class Classify(Section):
    """Leaf or wood."""

    method: Literal["reflectance", "mixture", "geometry", "all_leaf"] = key(
        "reflectance",
        "fixed threshold, threshold from the data, shape of the neighbourhood, or none",
    )
    threshold_db: float = key(-5.4, "reflectance above which a point is wood", FREY)
    majority_voxel_m: Positive = key(0.05, "voxels in which the majority decides", FREY)
