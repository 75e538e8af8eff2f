"""Leaf or wood."""

from __future__ import annotations

from typing import Annotated

from dapple.cloud.classifiers import CLASSIFIERS
from dapple.config.base import FREY, OneOf, Positive, Section, key


class Classify(Section):
    """Leaf or wood."""

    method: Annotated[str, OneOf(CLASSIFIERS)] = key(
        "auto",
        ", ".join(f"{name}: {one.summary}" for name, one in CLASSIFIERS.items()),
    )
    threshold_db: float = key(-5.4, "reflectance above which a point is wood", FREY)
    majority_voxel_m: Positive = key(0.05, "voxels in which the majority decides", FREY)
