"""One tree out of a plot: every point goes to the stem that it is nearest to along the plants."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from dapple.cloud import crowns, stems, voxel_groups
from dapple.cloud.ground_finder import GROUND_CLASS
from dapple.errors import InputError
from dapple.formats.clouds import Cloud
from dapple.formats.ground_surface import GroundSurface

LEAST_HEIGHT_M = 0.2
"""What lies lower is ground, grass and stones."""
POINTS_ON_STEM = 100
"""In the slice that shows stems; fewer, and the cloud was taken from above."""
PIXEL_M, LOWEST_CROWN_M = 0.5, 2.0
NODE_M = 0.1
MOST_NODES = 600_000
NEIGHBOURS = 12
LONGEST_LINK_M = 2.0
"""Gaps in a crown that are wider part it from its tree."""
ROOT_M = 0.5
"""Nodes of the stem's columns up to this height above the foot are its root."""
SAME_STEM_M = 3.0
"""A place that is named lies no farther from the stem it means."""


@dataclass(frozen=True)
class Plot:
    """A cloud divided into trees.

    Attributes
    ----------
    stems : pandas.DataFrame
        As of `stems.find`, local frame.
    tree : (n,) int64
        `id` of the tree of every point; 0: ground, and what belongs to none.
    found_by : {"stems", "crowns"}
        Crowns where the cloud was taken from above and shows no stems.
    """

    stems: pd.DataFrame
    tree: np.ndarray
    found_by: str


def divide(cloud: Cloud, surface: GroundSurface) -> Plot:
    """Give every point above the ground to a tree.

    Parameters
    ----------
    cloud : Cloud
        Local frame; points of class 2 are ground.
    surface : GroundSurface
    """
    up = cloud.xyz_m[:, 2] - surface.height_m(cloud.xyz_m[:, :2]) >= LEAST_HEIGHT_M
    if "Classification" in cloud.attributes:
        up &= cloud.attributes["Classification"] != GROUND_CLASS
    above = cloud.xyz_m[up]
    tree = np.zeros(len(cloud), np.int64)
    found, found_by = trees_of(above, surface)
    if len(found):
        own = assign(above, found, surface)
        if found_by == "crowns":
            own = _crowns(above, surface)[1]
        tree[up] = own
    return Plot(found, tree, found_by)


def trees_of(xyz_m: np.ndarray, surface: GroundSurface) -> tuple[pd.DataFrame, str]:
    """Stems, or crowns where hardly a point lies on stems; and which of them it is."""
    found = stems.find(xyz_m, surface)
    if len(found) and found["points"].median() >= POINTS_ON_STEM:
        return found, "stems"
    tops = _crowns(xyz_m, surface)[0] if len(xyz_m) else found
    return (tops, "crowns") if len(tops) > len(found) else (found, "stems")


def choose(
    found: pd.DataFrame,
    origin_m: np.ndarray,
    *,
    at_m: Sequence[float] | None = None,
    number: int | None = None,
    where: str | Path = "tree",
) -> int:
    """The number (`id`) of the tree that a place or a number means.

    Parameters
    ----------
    found : pandas.DataFrame
        As of `stems.find`, local frame.
    origin_m : (3,) float
        World coordinates of the local origin [m].
    at_m : (2,) float or None
        East and north of a place near the stem, world coordinates [m].
    number : int or None
        `id` of a tree.
    where : str or Path
        File or key, for messages.

    Raises
    ------
    InputError
        No tree, none of that number, or none near that place; the message lists those there are.
    """
    world = found[["x_m", "y_m"]].to_numpy(float) + np.asarray(origin_m, float)[:2]
    listed = ", ".join(
        f"{k} at [{x:.2f}, {y:.2f}]"
        for k, (x, y) in zip(found["id"].head(20), world[:20], strict=True)
    )
    expected = f"one of the {len(found)} trees that were found: {listed or 'none'}"
    remedy = "Name a tree by its number or by a place near its stem, east and north."
    if number is not None:
        if number not in set(found["id"]):
            raise InputError(where, f"`tree.id: {number}`", expected, remedy)
        return int(number)
    place = np.asarray(at_m, float)
    distance = np.hypot(*(world - place).T)
    reach = np.maximum(SAME_STEM_M, 0.5 * found["width_m"].to_numpy(float))
    if not len(distance) or (distance > reach).all():
        nearest = f", {distance.min():,.1f} m from the nearest" if len(distance) else ""
        raise InputError(
            where, f"`tree.at: [{place[0]:g}, {place[1]:g}]`{nearest}", expected, remedy
        )
    return int(found["id"].iloc[int(distance.argmin())])


def neighbours(plot: Plot, chosen: int, *, within_m: float) -> list[int]:
    """Numbers of the other trees whose stems are nearer than `within_m` to the chosen one's."""
    places = plot.stems.set_index("id")[["x_m", "y_m"]]
    distance = np.hypot(*(places - places.loc[chosen]).to_numpy(float).T)
    near = places.index[(distance < within_m) & (places.index != chosen)]
    return [int(k) for k in near]


def describe(plot: Plot, chosen: int, near: Sequence[int], origin_m: np.ndarray) -> dict[str, Any]:
    """What was chosen, in world coordinates, for a page and a picture."""
    row = plot.stems.set_index("id").loc[chosen]
    return {
        "id": chosen,
        "found_by": plot.found_by,
        "trees": len(plot.stems),
        "foot_m": [float(row[f"{axis}_m"] + o) for axis, o in zip("xyz", origin_m, strict=True)],
        "height_m": float(row["height_m"]),
        "points": int((plot.tree == chosen).sum()),
        "neighbours": list(near),
        "points_of_none": int((plot.tree == 0).sum()),
    }


def assign(xyz_m: np.ndarray, found: pd.DataFrame, surface: GroundSurface) -> np.ndarray:
    """The stem that every point belongs to.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Points above the ground, local frame [m].
    found : pandas.DataFrame
        As of `stems.find`, local frame; at least one.
    surface : GroundSurface

    Returns
    -------
    (n,) int64
        `id` of the stem; 0 for points that no path joins to any, such as shrubs and wires.

    Notes
    -----
    Comparative shortest paths (Tao et al. 2015, Methods in Ecology and Evolution 6): nodes are
    voxels, an edge costs its length squared, so that paths keep to what was scanned densely, and a
    node belongs to the stem whose root is the nearest one along the paths.
    """
    groups, nodes, _ = voxel_groups.nodes(xyz_m, NODE_M, MOST_NODES)
    k = min(NEIGHBOURS, len(nodes) - 1)
    if k < 1:
        return np.full(len(xyz_m), int(found["id"].iloc[0]))
    distance, neighbour = cKDTree(nodes).query(nodes, k + 1)
    start = np.repeat(np.arange(len(nodes)), k)
    end, length = neighbour[:, 1:].ravel(), distance[:, 1:].ravel()
    kept = length <= LONGEST_LINK_M
    graph = coo_matrix(
        (np.maximum(length[kept], 1e-6) ** 2, (start[kept], end[kept])), shape=(len(nodes),) * 2
    ).tocsr()
    graph = graph.maximum(graph.T)
    roots, owner = _roots(nodes, found, surface)
    cost, _, source = dijkstra(
        graph, directed=False, indices=roots, return_predecessors=True, min_only=True
    )
    by_root = np.zeros(len(nodes), np.int64)
    by_root[roots] = owner
    stem = np.where(np.isfinite(cost), by_root[np.where(source >= 0, source, 0)], 0)
    return stem[groups.voxel_of_point]


def _roots(
    nodes_m: np.ndarray, found: pd.DataFrame, surface: GroundSurface
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes at the feet of the stems, and the stem of each; at least the nearest node of a stem."""
    feet = found[["x_m", "y_m", "z_m"]].to_numpy(float)
    above = nodes_m[:, 2] - surface.height_m(nodes_m[:, :2])
    roots: dict[int, int] = {}
    plan = cKDTree(nodes_m[:, :2])
    for row, foot in zip(found.itertuples(), feet, strict=True):
        reach = 0.5 * float(row.width_m) + 0.15
        near = np.array(plan.query_ball_point(foot[:2], reach), int)
        low = near[above[near] <= ROOT_M] if len(near) else near
        if not len(low):
            candidates = near if len(near) else np.arange(len(nodes_m))
            offset = nodes_m[candidates] - foot
            low = candidates[[int(np.argmin((offset**2).sum(axis=1)))]]
        roots |= dict.fromkeys(low.tolist(), int(row.id))
    order = sorted(roots)
    return np.array(order), np.array([roots[node] for node in order])


def _crowns(xyz_m: np.ndarray, surface: GroundSurface) -> tuple[pd.DataFrame, np.ndarray]:
    """Trees by a watershed of the canopy's surface, and the tree of every point."""
    above = xyz_m[:, 2] - surface.height_m(xyz_m[:, :2])
    low = xyz_m[:, :2].min(axis=0)
    at = np.floor((xyz_m[:, :2] - low) / PIXEL_M).astype(np.int64)
    height = np.full(at.max(axis=0) + 1, np.nan)
    np.fmax.at(height, tuple(at.T), above)
    if not np.nanmax(height) >= LOWEST_CROWN_M:
        return pd.DataFrame({name: [] for name in stems.COLUMNS}), np.zeros(len(xyz_m), np.int64)
    label = crowns.crowns(
        height,
        pixel_m=PIXEL_M,
        min_height_m=LOWEST_CROWN_M,
        smoothing_m=0.7,
        min_distance_m=1.5,
        min_area_m2=2.0,
    )
    tree = label[tuple(at.T)].astype(np.int64)
    rows = []
    for number in range(1, int(label.max()) + 1):
        own = np.flatnonzero(tree == number)
        top = own[int(np.argmax(above[own]))]
        width = 2 * np.sqrt((label == number).sum() * PIXEL_M**2 / np.pi)
        rows.append((number, *xyz_m[top, :2], 0.0, width, above[top], len(own)))
    found = pd.DataFrame(rows, columns=list(stems.COLUMNS))
    found["z_m"] = surface.height_m(found[["x_m", "y_m"]].to_numpy(float))
    return found, tree
