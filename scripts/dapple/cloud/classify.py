"""Leaf or wood: by reflectance where there is one, by geometry where there is none."""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from sklearn.mixture import GaussianMixture

from dapple.cloud import branches, eigenvalues, voxel_groups
from dapple.errors import EmptyCloudError, InputError
from dapple.formats.clouds import LEAF, WOOD

MIN_SEPARATION = 2.0
"""Ashman's D above which two normal distributions are seen as two (Ashman et al. 1994)."""

MIN_SHARE = 0.01
"""A component with less of the points than this is a tail, not a class."""


@dataclass(frozen=True)
class Threshold:
    """Where two normal distributions of reflectance part.

    Attributes
    ----------
    threshold_db : float
        Between the means both components are equally likely here [dB].
    separation : float
        Ashman's D: difference of the means over the root mean square of the standard
        deviations; above 2 the two are distinct.
    mean_db, sd_db, share : (2,) float64
        Of the darker and of the brighter component.
    """

    threshold_db: float
    separation: float
    mean_db: np.ndarray
    sd_db: np.ndarray
    share: np.ndarray


class NotSeparableWarning(UserWarning):
    """The reflectances do not show two classes clearly."""


def codes(is_leaf: np.ndarray) -> np.ndarray:
    """(n,) uint8 class codes, 4 for leaf and 0 for wood."""
    return np.where(is_leaf, LEAF, WOOD).astype(np.uint8)


def by_reflectance(reflectance_db: np.ndarray, threshold_db: float = -5.4) -> np.ndarray:
    """Leaves are the points at or below a reflectance.

    Leaf water absorbs at 1550 nm, so that leaves are darker than bark; -5.4 dB is the threshold
    of Frey et al. (2025), Silva Fennica 59, 24027, for a RIEGL VZ-400i.

    Parameters
    ----------
    reflectance_db : (n,) array
        Range-corrected reflectance [dB].
    threshold_db : float
        Brighter points are wood [dB].

    Returns
    -------
    (n,) bool
        True for leaf.

    Raises
    ------
    InputError
        A reflectance is not a number: such a point is neither.
    """
    unknown = int(np.count_nonzero(np.isnan(reflectance_db)))
    if unknown:
        raise InputError(
            "Reflectance",
            f"{unknown} points without a value",
            "a reflectance in dB for every point",
            "Filter the cloud by reflectance first, or classify by geometry.",
        )
    return np.asarray(reflectance_db) <= threshold_db


def find_threshold(
    reflectance_db: np.ndarray, *, seed: int = 0, max_points: int = 200_000
) -> Threshold:
    """Find the reflectance that parts leaf and wood from the data themselves.

    Two normal distributions are fitted to the decibels; the threshold lies where a point between
    their means belongs to either with the same probability.

    Parameters
    ----------
    reflectance_db : (n,) array
        Reflectance [dB]; NaN does not count.
    seed : int
        Draws the points that are fitted, where there are more than `max_points`.
    max_points : int
        Number of points that are fitted at most.

    Returns
    -------
    Threshold

    Warns
    -----
    NotSeparableWarning
        Ashman's D is at or below 2: the components overlap so much that the threshold is weak.

    Raises
    ------
    InputError
        There is no threshold: too few values, or one component swallows the other.
    """
    values = np.asarray(reflectance_db, np.float64)
    values = values[np.isfinite(values)]
    if len(values) < 100 or np.ptp(values) == 0:
        raise _no_threshold(f"{len(values)} values, {len(np.unique(values))} of them different")
    if len(values) > max_points:
        values = np.random.default_rng(seed).choice(values, max_points, replace=False)
    start = np.percentile(values, [15, 85])[:, None]
    fit = GaussianMixture(2, means_init=start, random_state=0, max_iter=500).fit(values[:, None])
    order = np.argsort(fit.means_.ravel())
    mean, share = fit.means_.ravel()[order], fit.weights_[order]
    sd = np.sqrt(fit.covariances_.ravel()[order])
    separation = np.sqrt(2) * (mean[1] - mean[0]) / np.hypot(*sd)
    crossing = _crossing(mean, sd, share)
    if crossing is None or share.min() < MIN_SHARE:
        raise _no_threshold(
            f"components at {mean[0]:.2f} and {mean[1]:.2f} dB with shares "
            f"{share[0]:.3f} and {share[1]:.3f}, one inside the other"
        )
    if separation <= MIN_SEPARATION:
        warnings.warn(
            f"Reflectance: Ashman's D of the two components is {separation:.2f}, at or below "
            f"{MIN_SEPARATION}; leaf and wood overlap and the threshold {crossing:.2f} dB is weak. "
            "Compare it with a known one or classify by geometry.",
            NotSeparableWarning,
            stacklevel=2,
        )
    return Threshold(crossing, float(separation), mean, sd, share)


def by_geometry(
    xyz_m: np.ndarray,
    *,
    min_node_size_m: float = 0.02,
    min_support: int = 30,
    leaf_area_per_wood_area: float | None = None,
    root_height_m: float = 0.3,
    slack: float = 0.25,
    local_weight: float = 1.0,
) -> np.ndarray:
    """Part leaf from wood by where branches run, for clouds without reflectance.

    1. The cloud becomes nodes, one per voxel; shortest paths lead from every node to the stem
       base (Verroust and Lazarus 2000; for trees Vicari et al. 2019, Methods in Ecology and
       Evolution 10). Where many paths run together there is a branch.
    2. How thick it is follows from what it carries: the pipe model (Shinozaki et al. 1964) gives
       cross-section = carried leaf area / `leaf_area_per_wood_area`. Nodes within the diameter
       of a path are taken for wood.
    3. The sure nodes of both kinds teach a linear discriminant what wood looks like in this
       cloud: eigenvalues of the neighbourhoods at three scales (linearity, planarity,
       scattering, extent) and their tilt. It tips the balance for nodes in between.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Local frame, z up [m]; one tree or several on flat ground, without the ground.
    min_node_size_m : float
        Smallest voxel of the nodes [m]; on coarser clouds it is the spacing of the points.
    min_support : int
        Paths that carry fewer nodes than this are no branch.
    leaf_area_per_wood_area : float or None
        Area of the cloud that a cross-section of wood carries [m² m⁻²], 300 to 5000. None takes
        it from the stem's foot.
    root_height_m : float
        Paths end at nodes up to this height above the lowest [m].
    slack : float
        Distance to the branch that still is wood, as a share of the node size.
    local_weight : float
        Weight of step 3; 0 leaves it out.

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
    if len(xyz_m) < 50:
        raise EmptyCloudError(
            "point cloud",
            f"{len(xyz_m)} points",
            "at least 50 points of a tree",
            "Check the filters before.",
        )
    nodes_m, node_of_point, size_m = _nodes(xyz_m, min_node_size_m)
    carried = branches.support(nodes_m, root_height_m)
    if leaf_area_per_wood_area is None:
        foot_m2 = branches.foot_area_m2(nodes_m, size_m, root_height_m)
        leaf_area_per_wood_area = np.clip(len(nodes_m) * size_m**2 / max(foot_m2, 1e-9), 300, 5000)
    beyond = branches.distance_beyond_wood(
        nodes_m,
        np.sqrt(carried * size_m**2 / (np.pi * leaf_area_per_wood_area)),
        carried >= min_support,
        reach_m=2 * size_m,
    )
    evidence = 4.0 * (slack - beyond / size_m)
    if local_weight:
        features = eigenvalues.features(nodes_m, size_m)
        wood, leaf = beyond <= 0, beyond > size_m
        evidence = evidence + local_weight * eigenvalues.discriminate(features, wood, leaf)
    return ~(evidence > 0)[node_of_point]


def majority(xyz_m: np.ndarray, is_leaf: np.ndarray, voxel_size_m: float = 0.05) -> np.ndarray:
    """Give all points of a voxel the class of the most of them; equal votes make leaf.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Local frame [m].
    is_leaf : (n,) bool
        True for leaf.
    voxel_size_m : float
        Edge of the voxels [m], aligned to multiples of it from the local origin; Frey et al.
        (2025) take 5 cm.

    Returns
    -------
    (n,) bool
        True for leaf.
    """
    if len(xyz_m) == 0:
        return np.zeros(0, bool)
    groups = voxel_groups.group(xyz_m, voxel_size_m)
    leaf_wins = 2 * groups.total(np.asarray(is_leaf)) >= groups.size
    return leaf_wins[groups.voxel_of_point]


def _nodes(xyz_m: np.ndarray, min_size_m: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Centres of gravity of voxels no smaller than the spacing of the points."""
    some = xyz_m[:: max(1, len(xyz_m) // 20_000)]
    distance, _ = cKDTree(xyz_m).query(some, 2)
    size_m = max(min_size_m, float(np.median(distance[:, 1])))
    groups = voxel_groups.group(xyz_m, size_m)
    return groups.total(xyz_m) / groups.size[:, None], groups.voxel_of_point, size_m


def _crossing(mean: np.ndarray, sd: np.ndarray, share: np.ndarray) -> float | None:
    """Where share × density of both normal distributions is equal between their means."""
    weight = np.log(share / sd)
    roots = np.roots(
        [
            0.5 / sd[1] ** 2 - 0.5 / sd[0] ** 2,
            mean[0] / sd[0] ** 2 - mean[1] / sd[1] ** 2,
            0.5 * (mean[1] / sd[1]) ** 2 - 0.5 * (mean[0] / sd[0]) ** 2 + weight[0] - weight[1],
        ]
    )
    between = [r.real for r in roots if abs(r.imag) < 1e-9 and mean[0] < r.real < mean[1]]
    return float(between[0]) if len(between) == 1 else None


def _no_threshold(found: str) -> InputError:
    return InputError(
        "Reflectance",
        found,
        "two overlapping but distinct groups, leaf and wood",
        "Give a threshold in dB, or classify by geometry.",
    )
