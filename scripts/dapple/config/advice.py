"""How finely light has to be computed."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Gt, Le

from dapple.config.base import Count, Positive, Section, Some, key


class Advice(Section):
    """What each refinement of the light changes and costs, measured on a pilot."""

    tolerance: Annotated[float, Gt(0), Le(1)] = key(
        0.02, "what may be left out in all: RMSE as a share of open-sky PAR"
    )
    sensors: Count = key(12, "sensors of the pilot")
    times: Count = key(9, "times of the pilot")
    paths: Count = key(16_384, "paths, and rays to the sky, of every sensor of the pilot")
    repeats: Count = key(3, "runs of every model, of which the shortest counts as its cost")
    polygon_sizes_m: Some[Positive] = key(
        (0.025, 0.05, 0.1, 0.2), "voxels of the polygons, the finest first"
    )
    voxel_sizes_m: Some[Positive] = key(
        (0.1, 0.2, 0.5, 1.0), "edges of the turbid voxels, the finest first"
    )
