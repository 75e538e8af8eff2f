"""The noise filter."""

from __future__ import annotations

from typing import Literal

from dapple.config.base import FREY, Count, NotNegative, Positive, Section, key


class Clean(Section):
    """The noise filter."""

    min_reflectance_db: float = key(-15.0, "points at or below are dropped", FREY)
    max_deviation: Positive = key(15.0, "points at or above are dropped", FREY)
    outlier_backend: Literal["cloudcompare", "pdal", "none"] = key(
        "cloudcompare", "program that finds statistical outliers"
    )
    outlier_neighbours: Count = key(8, "neighbours whose mean distance is judged")
    outlier_multiplier: Positive = key(
        3.0, "standard deviations beyond which a point is an outlier"
    )
    thin_voxel_m: Positive = key(0.01, "one point is left in a voxel of this size", FREY)
    distance_points: Count = key(200_000, "points whose distance from the polygons is measured")
    min_height_m: NotNegative = key(0.1, "points lower above the ground are dropped")
