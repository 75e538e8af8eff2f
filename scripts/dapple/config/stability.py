"""The stability map."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Le

from dapple.config.base import Count, Section, key

Method = Literal[
    "polygons",
    "voxels_0.2",
    "voxels_1.0",
    "virtual_leaves",
    "polygons_corrected",
    "voxels_0.2_corrected",
    "voxels_1.0_corrected",
]


class Stability(Section):
    """Where methods fail: one thing at a time made worse in virtual worlds."""

    stressors: tuple[str, ...] = key((), "stressors to apply; empty: all")
    levels: Annotated[int, Ge(2)] = key(6, "most levels of each stressor")
    seeds: Count = key(3, "worlds for each level")
    reconstructions: tuple[Method, ...] = key((), "methods to run; empty: all")
    bands: Annotated[int, Ge(1), Le(3)] = key(3, "groups of bands, traced together")
    truth_factor: Count = key(4, "how many times more rays the true world gets")
