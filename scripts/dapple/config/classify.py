"""Leaf or wood."""

from __future__ import annotations

from typing import Annotated

from dapple.cloud.classifiers import CLASSIFIERS
from dapple.config.base import FREY, Count, NotNegative, OneOf, Positive, Section, Share, key


class Geometry(Section):
    """Wood by the course of branches (`method: geometry`): lengths are those of the cloud."""

    node_spacings: Positive = key(1.5, "edge of the nodes, in distances of neighbouring points")
    node_share: Share = key(0.005, "smallest edge of the nodes, as a share of the cloud's height")
    foot_share: Share = key(0.04, "paths end below this share of the cloud's height")
    thinnest_branch: NotNegative = key(0.5, "radius of the thinnest branch, in nodes")
    leaf_area_per_wood_area: Positive | None = key(
        None, "leaf area that a cross-section of wood carries; none: from the stem"
    )
    slack: NotNegative = key(0.25, "distance from the branch that still is wood, in nodes")


class Classify(Section):
    """Leaf or wood."""

    method: Annotated[str, OneOf(CLASSIFIERS)] = key(
        "auto",
        ", ".join(f"{name}: {one.summary}" for name, one in CLASSIFIERS.items()),
    )
    threshold_db: float = key(-5.4, "reflectance above which a point is wood", FREY)
    majority_voxel_m: Positive = key(0.05, "voxels in which the majority decides", FREY)
    geometry: Geometry = Geometry()
    model: str = key(
        "", "learned: file of another model, relative to data_dir; empty: the one that comes along"
    )
    training_trees: Count = key(40, "virtual scans from which `leaf_wood_model` learns")
