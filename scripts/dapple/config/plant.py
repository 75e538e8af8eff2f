"""The virtual apple tree."""

from __future__ import annotations

from dapple.config.base import FREY, LeafAngles, Positive, Section, key


class Plant(Section):
    """The virtual apple tree (`source: virtual`)."""

    height_m: Positive = key(6.6, "height", FREY)
    crown_base_m: Positive = key(2.1, "height of the lowest leaves", FREY)
    crown_radius_m: Positive = key(3.78, "radius of the crown; projection 45 m²", FREY)
    dbh_m: Positive = key(0.19, "stem diameter at 1.3 m", FREY)
    leaf_area_m2: Positive = key(90.0, "one-sided leaf area")
    leaf_length_min_m: Positive = key(0.05, "shortest leaf")
    leaf_length_max_m: Positive = key(0.08, "longest leaf")
    leaf_angle_distribution: LeafAngles = key("spherical", "of the leaf normals")
