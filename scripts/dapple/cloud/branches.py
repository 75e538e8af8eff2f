"""Branches in a cloud of nodes: where the shortest paths to the stem base run together."""

import numba
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

NEIGHBOURS = 12
SLICES = 5
"""Slices above the ground in which the stem's cross-section is looked for."""


def support(nodes_m: np.ndarray, root_top_m: float) -> np.ndarray:
    """Number of nodes whose shortest path to the base runs through each node.

    Parameters
    ----------
    nodes_m : (n, 3) float64
        Local frame, z up [m].
    root_top_m : float
        Paths end at nodes up to this height [m].

    Returns
    -------
    (n,) float64
        1 where no other path passes.

    Notes
    -----
    An edge costs its length squared, so that paths keep to densely scanned wood instead of
    leaping from leaf to leaf.
    """
    k = min(NEIGHBOURS, len(nodes_m) - 1)
    distance, neighbour = cKDTree(nodes_m).query(nodes_m, k + 1)
    start = np.repeat(np.arange(len(nodes_m)), k)
    graph = _graph(start, neighbour[:, 1:].ravel(), distance[:, 1:].ravel(), len(nodes_m))
    graph = graph + _bridges(nodes_m, graph)
    roots = np.flatnonzero(nodes_m[:, 2] <= root_top_m)
    cost, previous, _ = dijkstra(
        graph, directed=False, indices=roots, return_predecessors=True, min_only=True
    )
    far_first = np.argsort(-cost, kind="stable")
    carried = _collect(far_first, previous.astype(np.int64))
    # Paths arrive all around a stem: each foot carries what all its nodes carry together.
    _, foot = connected_components(graph[roots][:, roots], directed=False)
    carried[roots] = np.bincount(foot, carried[roots])[foot]
    return carried


def stem_area_m2(nodes_m: np.ndarray, size_m: float, foot_m: float, slice_m: float) -> float:
    """Cross-section of all stems above the flare of their feet.

    Parameters
    ----------
    nodes_m : (n, 3) float64
        Local frame, z up [m].
    size_m : float
        Spacing of the nodes; nodes within twice of it belong to one stem [m].
    foot_m : float
        Height of the ground [m].
    slice_m : float
        Thickness of the slices above it [m].

    Returns
    -------
    float
        Of the slice where it is smallest: the sum of circles whose radius is the median distance
        of a stem's nodes from their axis [m²]. A foot is wider than its stem, and so is whatever
        leaves hang beside it. 0 where no slice has a stem through it.
    """
    areas = [
        _area_of_slice_m2(nodes_m, size_m, foot_m + k * slice_m, slice_m) for k in range(SLICES)
    ]
    return min((area for area in areas if area > 0), default=0.0)


def _area_of_slice_m2(nodes_m: np.ndarray, size_m: float, low_m: float, slice_m: float) -> float:
    inside = nodes_m[(nodes_m[:, 2] >= low_m) & (nodes_m[:, 2] < low_m + slice_m)]
    if len(inside) < 2:
        return 0.0
    pairs = cKDTree(inside).query_pairs(2 * size_m, output_type="ndarray")
    linked = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(inside),) * 2)
    n_stems, stem = connected_components(linked, directed=False)
    area_m2 = 0.0
    for number in range(n_stems):
        own = inside[stem == number]
        if np.ptp(own[:, 2]) > 0.6 * slice_m:
            plan = own[:, :2]
            axis = 0.5 * (plan.min(axis=0) + plan.max(axis=0))
            area_m2 += np.pi * float(np.median(np.hypot(*(plan - axis).T))) ** 2
    return area_m2


def distance_beyond_wood(
    places_m: np.ndarray, branch_m: np.ndarray, radius_m: np.ndarray, reach_m: float
) -> np.ndarray:
    """How far places lie outside the nearest branch.

    Parameters
    ----------
    places_m : (n, 3) float64
        Local frame [m].
    branch_m : (b, 3) float64
        Nodes of branches. They lie on the surface of the wood, which may be up to a diameter away
        on the other side [m].
    radius_m : (b,) float64
        Radius of the branch that each is part of [m].
    reach_m : float
        Distances beyond this need not be known [m].

    Returns
    -------
    (n,) float64
        Distance to a branch node less the branch's diameter, at most `reach_m` [m].
    """
    beyond = np.full(len(places_m), reach_m)
    if len(branch_m) == 0:
        return beyond
    diameter = 2 * radius_m
    # One search per half octave of diameters: a node that is near enough to the largest of a
    # group would otherwise be searched for once per branch node.
    octave = np.floor(2 * np.log2(diameter / reach_m)).astype(int)
    for step in np.unique(octave):
        chosen = octave == step
        typical = float(diameter[chosen].mean())
        distance, _ = cKDTree(branch_m[chosen]).query(
            places_m, distance_upper_bound=typical + reach_m
        )
        beyond = np.minimum(beyond, distance - typical)
    return beyond


def _graph(start, end, distance, n):
    cost = np.maximum(distance**2, np.finfo(float).tiny)
    graph = coo_matrix((cost, (start, end)), shape=(n, n)).tocsr()
    return graph.maximum(graph.T)


def _bridges(nodes_m: np.ndarray, graph):
    """The shortest link from each loose piece to the largest one."""
    n_pieces, piece = connected_components(graph, directed=False)
    main = np.argmax(np.bincount(piece))
    inside, loose = np.flatnonzero(piece == main), np.flatnonzero(piece != main)
    if n_pieces == 1:
        return _graph([], [], np.empty(0), len(nodes_m))
    distance, nearest = cKDTree(nodes_m[inside]).query(nodes_m[loose])
    order = np.lexsort((distance, piece[loose]))
    first = order[np.flatnonzero(np.diff(piece[loose][order], prepend=-1))]
    return _graph(loose[first], inside[nearest[first]], distance[first], len(nodes_m))


@numba.njit(cache=True)
def _collect(far_first, previous):
    carried = np.ones(len(far_first))
    for node in far_first:
        if previous[node] >= 0:
            carried[previous[node]] += carried[node]
    return carried
