"""Plant area density in voxels."""

from __future__ import annotations

from typing import Annotated

from dapple.config.base import (
    FREY,
    Count,
    LeafAngles,
    NotNegative,
    OneOf,
    Positive,
    Section,
    Some,
    key,
)
from dapple.structure.pad_estimators import ESTIMATORS


class Voxels(Section):
    """Plant area density."""

    sizes_m: Some[Positive] = key(
        (0.2, 1.0), "edges of the voxels; 0.1 where plant area matters and the scan is dense", FREY
    )
    estimator: Annotated[str, OneOf(ESTIMATORS)] = key(
        "fpl",
        ", ".join(f"{name}: {one.summary}" for name, one in ESTIMATORS.items()),
        "Pimont et al. 2018",
    )
    leaf_angle_distribution: LeafAngles = key("spherical", "of the leaf normals", FREY)
    single_leaf_area_m2: NotNegative = key(
        0.0,
        "one-sided, for the finite-element correction by the parts of leaves in a voxel; 0: none",
        "Pimont et al. 2018",
    )
    max_pad_m2_m3: Positive = key(5.0, "cap of plant area density", "AMAPVox")
    min_shots: Count = key(5, "fewer shots leave a voxel unknown", "AMAPVox")
    contact_voxel_m: NotNegative = key(
        0.05, "sub-voxels of the contact frequency; 0: none", "Hosoi and Omasa 2006"
    )
    beam_divergence_mrad: NotNegative = key(0.0, "weight shots by their beam's section; 0: equally")
    beam_diameter_m: NotNegative = key(0.0, "beam's diameter at the scanner, for that weight")
    allow_missing_misses: bool = key(False, "go on where every shot of a scan has a return")
