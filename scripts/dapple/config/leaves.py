"""Virtual leaves along real wood."""

from __future__ import annotations

from dapple.config.base import FREY, Count, LeafAngles, NotNegative, Positive, Section, Share, key


class Leaves(Section):
    """Virtual leaf polygons along real wood (`source: wood`)."""

    path: str = key(
        "",
        "OBJ of real leaves in LESS axes, relative to data_dir; taken instead where it is there",
    )
    placements: Count = key(8, "independent placements; light is their mean")
    leaf_area_m2: Positive = key(187.0, "area of all leaf polygons", FREY)
    n_elements: Count = key(147_098, "leaf polygons, one in a 5 cm voxel", FREY)
    small_share: Share = key(
        round(40_190 / 147_098, 4), "share of polygons made of one or two points", FREY
    )
    crown_base_m: NotNegative = key(2.1, "no leaf is lower above the stem's foot", FREY)
    max_distance_m: Positive = key(0.3, "longest shoot")
    # Of nine pairs these two come nearest to the published 6,960 voxels of 0.2 m and 44.8 m².
    clump_radius_m: Positive = key(0.04, "spread of leaves across their shoot")
    leaves_per_shoot: Count = key(600, "leaves that share a shoot")
    thin_wood_m2: Positive = key(0.001, "wood polygons of this area carry half as many shoots")
    leaf_angle_distribution: LeafAngles = key("spherical", "of the polygons' normals", FREY)
