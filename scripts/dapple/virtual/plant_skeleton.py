"""Branching of a virtual tree: where its wood runs, and how thick it is."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

_UP = np.array([0.0, 0.0, 1.0])
_WIDEST = 0.3  # relative height in the crown at which it is widest
_GOLDEN_RAD = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True)
class Skeleton:
    """Nodes of a tree of branch axes; node 0 stands on the ground.

    Attributes
    ----------
    xyz_m : (n, 3) float64
        Local frame, stem base at the origin [m].
    parent : (n,) int64
        Index of the node towards the stem base, smaller than the node's own; -1 for node 0.
    """

    xyz_m: np.ndarray
    parent: np.ndarray

    @property
    def tips(self) -> np.ndarray:
        """Nodes from which nothing grows."""
        return np.setdiff1d(np.arange(len(self.parent)), self.parent)

    def direction(self, nodes: np.ndarray) -> np.ndarray:
        """(k, 3) unit vectors from the parents of `nodes` (not node 0) to these."""
        return unit(self.xyz_m[nodes] - self.xyz_m[self.parent[nodes]])

    def stretched(self, sideways: float, upwards: float, from_z_m: float) -> "Skeleton":
        """The same tree, widened about its axis, and heightened above `from_z_m`."""
        xyz = self.xyz_m * [sideways, sideways, 1.0]
        xyz[:, 2] += np.maximum(xyz[:, 2] - from_z_m, 0.0) * (upwards - 1)
        return Skeleton(xyz, self.parent)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) at length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def grow(
    height_m: float,
    crown_base_m: float,
    crown_radius_m: float,
    n_tips: int,
    n_clumps: int,
    rng: np.random.Generator,
) -> Skeleton:
    """Grow a stem, main limbs and the branches that fill a crown.

    Parameters
    ----------
    height_m, crown_base_m, crown_radius_m : float
        Size of the envelope that branches fill [m].
    n_tips : int
        Number of points in the crown that branches grow towards.
    n_clumps : int
        Three quarters of these points lie in so many clumps, so that the crown has gaps.
    rng : numpy.random.Generator

    Returns
    -------
    Skeleton

    Notes
    -----
    Space colonisation (Runions et al. 2007, "Modeling trees with a space colonization
    algorithm"), started from a stem with five ascending limbs as growers of apple trees form it.
    """
    targets = _targets(height_m, crown_base_m, crown_radius_m, n_tips, n_clumps, rng)
    volume_m3 = 2.0 * crown_radius_m**2 * (height_m - crown_base_m)
    spacing_m = (volume_m3 / n_tips) ** (1 / 3)
    start = _stem_and_limbs(height_m, crown_base_m, crown_radius_m, 0.25 * spacing_m, rng)
    return _colonise(start, targets, 0.25 * spacing_m, 0.45 * spacing_m, rng)


def _crown_radius(relative_height: np.ndarray) -> np.ndarray:
    """Radius of the envelope at relative heights from 0 to 1, as a share of the widest."""
    below = (_WIDEST - relative_height) / (1.2 * _WIDEST)
    above = (relative_height - _WIDEST) / (1 - _WIDEST)
    shape = np.where(relative_height < _WIDEST, below, np.maximum(above, 0))
    return np.sqrt(np.maximum(1 - shape**2, 0))


def _targets(height_m, crown_base_m, crown_radius_m, n, n_clumps, rng) -> np.ndarray:
    """Points in the crown, most of them in clumps, (n, 3) [m]."""
    depth_m = height_m - crown_base_m
    lobes = 1 + 0.12 * np.sin(rng.uniform(0, 2 * np.pi, 2))  # no crown is round
    turn = rng.uniform(0, 2 * np.pi)

    def inside(points):
        azimuth = np.arctan2(points[:, 1], points[:, 0]) + turn
        lobe = 1 + (lobes[0] - 1) * np.cos(2 * azimuth) + (lobes[1] - 1) * np.cos(3 * azimuth)
        relative = (points[:, 2] - crown_base_m) / depth_m
        reach = crown_radius_m * lobe * _crown_radius(relative)
        return (relative > 0) & (relative < 1) & (np.hypot(*points[:, :2].T) < reach)

    def even(count):
        box = rng.uniform(-1, 1, (8 * count + 64, 3)) * [1.3, 1.3, 0.5] + [0, 0, 0.5]
        points = box * [crown_radius_m, crown_radius_m, depth_m] + [0, 0, crown_base_m]
        return points[inside(points)][:count]

    spread_m = 0.3 * (2.0 * crown_radius_m**2 * depth_m / n_clumps) ** (1 / 3)
    centres = even(n_clumps)
    own = rng.integers(len(centres), size=2 * n)
    clumped = centres[own] + spread_m * rng.standard_normal((2 * n, 3))
    clumped = clumped[inside(clumped)][: round(0.75 * n)]
    return np.concatenate([clumped, even(n - len(clumped))])


def _stem_and_limbs(height_m, crown_base_m, crown_radius_m, step_m, rng) -> Skeleton:
    """Stem from the ground into the crown, and five limbs that leave it near the crown base."""
    leader_m = crown_base_m + 0.45 * (height_m - crown_base_m)
    n_stem = max(int(np.ceil(leader_m / step_m)), 4)
    z = np.linspace(0, leader_m, n_stem + 1)
    lean = rng.normal(0, 0.02, 2) * z[:, None] + rng.normal(0, 0.02) * np.sin(z * 2)[:, None]
    nodes = [np.column_stack([lean, z])]
    parents = [np.arange(-1, n_stem)]
    first_azimuth = rng.uniform(0, 2 * np.pi)
    for limb in range(5):
        base_z = crown_base_m * 0.93 + limb * 0.07 * (height_m - crown_base_m)
        start = int(np.argmin(np.abs(z - base_z)))
        azimuth = first_azimuth + limb * _GOLDEN_RAD
        elevation = np.radians(rng.uniform(25, 50) + 4 * limb)
        n = max(int(rng.uniform(0.45, 0.6) * crown_radius_m / step_m), 2)
        bend = np.linspace(1.3, 0.6, n) * elevation  # limbs bow outwards under their load
        azimuths = azimuth + np.cumsum(rng.normal(0, 0.05, n))
        steps = np.column_stack(
            [np.cos(azimuths) * np.cos(bend), np.sin(azimuths) * np.cos(bend), np.sin(bend)]
        )
        count = sum(map(len, nodes))
        nodes.append(nodes[0][start] + step_m * np.cumsum(steps, axis=0))
        parents.append(np.r_[start, np.arange(count, count + n - 1)])
    return Skeleton(np.concatenate(nodes), np.concatenate(parents))


def _colonise(start: Skeleton, targets, step_m, reached_m, rng) -> Skeleton:
    """Let branches grow towards the targets nearest to them until each is reached."""
    xyz, parent = start.xyz_m, start.parent
    may_grow = np.flatnonzero(xyz[:, 2] > 0.85 * targets[:, 2].min())  # no branches on the stem
    distance, nearest = cKDTree(xyz[may_grow]).query(targets)
    nearest = may_grow[nearest]
    while (waiting := distance > reached_m).any():
        targets, distance, nearest = targets[waiting], distance[waiting], nearest[waiting]
        growing, which = np.unique(nearest, return_inverse=True)
        pull = np.zeros((len(growing), 3))
        np.add.at(pull, which, unit(targets - xyz[nearest]))
        heading = unit(xyz[growing] - xyz[np.maximum(parent[growing], 0)] + 1e-9 * _UP)
        wish = unit(pull + 1e-9 * _UP) + 0.35 * heading + rng.normal(0, 0.1, pull.shape)
        grown = xyz[growing] + step_m * unit(wish)
        # a node pulled two ways would grow the same twig for ever
        fresh = cKDTree(xyz).query(grown)[0] > 0.5 * step_m
        reachable = fresh[which]
        targets, distance, nearest = targets[reachable], distance[reachable], nearest[reachable]
        if not fresh.any():
            break
        new_distance, new = cKDTree(grown[fresh]).query(targets)
        closer = new_distance < distance
        distance = np.where(closer, new_distance, distance)
        nearest = np.where(closer, len(xyz) + new, nearest)
        xyz, parent = np.concatenate([xyz, grown[fresh]]), np.r_[parent, growing[fresh]]
    return Skeleton(xyz, parent)


def radii(skeleton: Skeleton, dbh_m: float, breast_height_m: float, twig_m: float) -> np.ndarray:
    """Radius of the wood at every node.

    Parameters
    ----------
    skeleton : Skeleton
    dbh_m : float
        Stem diameter at `breast_height_m` [m].
    breast_height_m : float
        Height of that diameter [m].
    twig_m : float
        Radius of the thinnest twigs [m].

    Returns
    -------
    (n,) float64
        Radii [m], never larger than the parent's.

    Notes
    -----
    Pipe model (Shinozaki et al. 1964): r^e of a branch is the sum of r^e of what it carries; the
    exponent e is the one that leads from the twigs to the given stem.
    """
    load = np.full(len(skeleton.parent), 0.03)  # a branch thins a little between its forks too
    load[skeleton.tips] += 1.0
    for node in range(len(load) - 1, 0, -1):
        load[skeleton.parent[node]] += load[node]
    z_m = skeleton.xyz_m[:, 2]
    stem = _main_axis(skeleton.parent, load)
    at_breast = load[stem][z_m[stem] >= breast_height_m][0]
    exponent = np.log(at_breast / load.min()) / np.log(0.5 * dbh_m / twig_m)
    radius = twig_m * (load / load.min()) ** (1 / exponent)
    below = np.clip(1 - z_m[stem] / breast_height_m, 0, 1)
    radius[stem] *= 1 + 0.3 * below**2  # root flare
    return radius


def _main_axis(parent: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Nodes from the ground up, taking the heaviest branch at each fork."""
    follow = heaviest_child(parent, load)
    axis = [0]
    while (node := follow[axis[-1]]) >= 0:
        axis.append(int(node))
    return np.array(axis)


def heaviest_child(parent: np.ndarray, load: np.ndarray) -> np.ndarray:
    """(n,) the child of each node with the largest `load`, -1 where there is none."""
    follow = np.full(len(parent), -1)
    order = np.argsort(load[1:], kind="stable") + 1  # the heaviest writes last
    follow[parent[order]] = order
    return follow
