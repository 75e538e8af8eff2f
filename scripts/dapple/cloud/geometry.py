"""Leaf or wood by the course of branches, for clouds without reflectance."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dapple.cloud import branches, eigenvalues, voxel_groups
from dapple.errors import EmptyCloudError
from dapple.formats.clouds import Cloud
from dapple.progress import followed

LEAST_POINTS = 50
QUANTUM = 1e-9
"""Coordinates are rounded to this share of the cloud's extent: where it stands is forgotten."""
COARSER = 1, 2, 4
"""Nodes of so many times the size are looked at, too: on them paths around a thick stem are one."""
SPACING_POINTS = 20_000
"""Of so many points the distance to their neighbours is measured."""
MOST_NODES = 3_000_000
"""Of larger clouds the nodes are coarser: paths through more do not fit into memory."""
NEIGHBOURHOODS = 4 / 3, 7 / 3, 14 / 3
"""Thirds of their width, in nodes."""
DISTANCE_COUNTS = 4.0
"""A node's width of distance from a branch is worth so many log odds of shape."""
LEAF_AREA_PER_WOOD_AREA = 300.0, 5000.0
"""Bounds of what is taken from the cloud."""


def along_branches(
    cloud: Cloud, settings: Mapping[str, Any], seed: int
) -> tuple[np.ndarray, dict[str, float]]:
    """Wood is where paths from leaves to the stem run together; see `classifiers.Method`."""
    return by_geometry(cloud.xyz_m, **settings.get("geometry", {})), {}


def by_geometry(
    xyz_m: np.ndarray,
    *,
    node_spacings: float = 1.5,
    node_share: float = 0.005,
    foot_share: float = 0.04,
    thinnest_branch: float = 0.5,
    leaf_area_per_wood_area: float | None = None,
    slack: float = 0.25,
) -> np.ndarray:
    """Part leaf from wood by where branches run.

    1. The cloud becomes nodes, one per voxel; shortest paths lead from every node to the stem
       base (Verroust and Lazarus 2000; for trees Vicari et al. 2019, Methods in Ecology and
       Evolution 10). Where many paths run together there is a branch.
    2. How thick it is follows from what it carries: the pipe model (Shinozaki et al. 1964) gives
       cross-section = carried leaf area / `leaf_area_per_wood_area`. Nodes within the diameter
       of a path are taken for wood.
    3. Nodes that are surely of one kind by this teach a linear discriminant what wood looks like
       in this cloud (`eigenvalues.discriminate`), which tips the balance for nodes in between.

    All lengths are taken from the cloud: its unit, its place and its height above the sea do not
    matter.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Local frame, z up [m]; one tree or several on flat ground, without the ground.
    node_spacings : float
        Edge of the nodes, in median distances of neighbouring points.
    node_share : float
        Smallest edge of the nodes, as a share of the cloud's height.
    foot_share : float
        Paths end at nodes up to this share of the cloud's height.
    thinnest_branch : float
        Paths that would be a branch of less than this radius, in nodes, are none; on the coarser
        nodes of less than twice as much.
    leaf_area_per_wood_area : float or None
        Area of the cloud that a cross-section of wood carries [m² m⁻²]. None takes it from the
        stem, within 300 to 5000.
    slack : float
        Distance to the branch that is wood as likely as leaf, where shape does not tell, in nodes.

    Returns
    -------
    (n,) bool
        True for leaf.

    Raises
    ------
    EmptyCloudError
        Fewer than 50 points.

    Notes
    -----
    Twigs thinner than the spacing of the points cannot be told from leaves and count as leaves.
    A cloud without a stem (from above, or a crown alone) has no root: results are then poor.
    """
    xyz_m = np.asarray(xyz_m, np.float64)
    if len(xyz_m) < LEAST_POINTS:
        raise EmptyCloudError(
            "point cloud",
            f"{len(xyz_m)} points",
            f"at least {LEAST_POINTS} points of a tree",
            "Check the filters before.",
        )
    xyz_m = _at_home(xyz_m)
    foot_m, top_m = np.quantile(xyz_m[:, 2], [0.0005, 0.9995])
    height_m = float(top_m - foot_m)
    size_m = max(node_spacings * _spacing_m(xyz_m), node_share * height_m)
    groups, places_m, size_m = voxel_groups.nodes(xyz_m, size_m, MOST_NODES)
    slice_m = max(foot_share * height_m, 2 * size_m)
    beyond_m = np.full(len(places_m), np.inf)
    for coarser in COARSER:
        node_m = coarser * size_m
        nodes_m = places_m
        if coarser > 1:
            nodes_m = voxel_groups.nodes(xyz_m, node_m, MOST_NODES)[1]
        ratio = leaf_area_per_wood_area
        if ratio is None:
            stem_m2 = branches.stem_area_m2(nodes_m, node_m, foot_m, max(slice_m, 2 * node_m))
            ratio = len(nodes_m) * node_m**2 / stem_m2 if stem_m2 else np.inf
            ratio = float(np.clip(ratio, *LEAF_AREA_PER_WOOD_AREA))
        carried = branches.support(nodes_m, foot_m + slice_m)
        radius_m = np.sqrt(carried * node_m**2 / (np.pi * ratio))
        thick = radius_m >= thinnest_branch * min(coarser, 2) * node_m  # coarse paths wander
        found = branches.distance_beyond_wood(
            places_m, nodes_m[thick], radius_m[thick], reach_m=2 * size_m
        )
        beyond_m = np.minimum(beyond_m, found)
    edges = followed(NEIGHBOURHOODS, "sizes of neighbourhoods")
    shapes = [eigenvalues.around(places_m, edge * size_m) for edge in edges]
    features = np.concatenate([one.shape[one.voxel_of_point] for one in shapes], axis=1)
    alike = eigenvalues.discriminate(features, beyond_m <= 0, beyond_m > size_m)
    wood = DISTANCE_COUNTS * (slack - beyond_m / size_m) + alike > 0
    return ~wood[groups.voxel_of_point]


def _at_home(xyz_m: np.ndarray) -> np.ndarray:
    """The cloud with its lowest corner at the origin, without the rounding of where it stood."""
    corner = xyz_m.min(axis=0)
    quantum = QUANTUM * max(float((xyz_m.max(axis=0) - corner).max()), np.finfo(float).tiny)
    return np.round((xyz_m - corner) / quantum) * quantum


def _spacing_m(xyz_m: np.ndarray) -> float:
    """Median distance of neighbouring points."""
    some = xyz_m[:: max(1, len(xyz_m) // SPACING_POINTS)]
    distance, _ = cKDTree(xyz_m).query(some, 2)
    return float(np.median(distance[:, 1]))
