"""Leaf or wood: every point gets the class that its neighbourhood votes for."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dapple import findings
from dapple.cloud import voxel_groups
from dapple.cloud.classifiers import CLASSIFIERS
from dapple.cloud.scores import scores
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import clouds
from dapple.formats.clouds import LEAF, WOOD, Cloud

MOST_WOOD = 0.4
"""More of the points of a tree in leaf are not wood: of twelve virtual scans 14 to 32 % were, and
where leaves were brighter than the threshold it made 42 to 71 % wood (docs/data/classifier.csv)."""


def classify(
    cloud: Cloud,
    method: str,
    *,
    majority_voxel_m: float = 0.05,
    seed: int = 0,
    where: str | Path = "cloud",
    **settings: Any,
) -> tuple[Cloud, dict[str, Any]]:
    """Tell leaf from wood.

    Parameters
    ----------
    cloud : Cloud
        Cleaned.
    method : str
        One of `classifiers.CLASSIFIERS`.
    majority_voxel_m : float
        Edge of the voxels in which the majority decides, see `majority` [m].
    seed : int
        For methods that draw points.
    where : str or Path
        The file to name in errors.
    **settings
        Further keys of the section `classify`, for the method.

    Returns
    -------
    cloud : Cloud
        With `Classification`: 4 for leaf, 0 for wood.
    facts : dict
        `method` (of auto the one that it took), `points`, what the method tells, `leaf_share` and,
        where the cloud has a `TrueClass`, its `scores`.

    Raises
    ------
    InputError
        A method that there is not, or an attribute that it needs and the cloud lacks.
    """
    if method not in CLASSIFIERS:
        raise InputError(
            "classify.method", repr(method), f"one of {', '.join(CLASSIFIERS)}", "Choose one."
        )
    classifier = CLASSIFIERS[method]
    for name in classifier.needs:
        clouds.require(cloud, name, where)
    leaf, found = classifier.load()(cloud, settings, seed)
    leaf = majority(cloud.xyz_m, leaf, majority_voxel_m)
    facts = {"method": method, "points": len(cloud), **found, "leaf_share": float(leaf.mean())}
    kinds = codes(leaf)
    if "TrueClass" in cloud.attributes:
        facts["scores"] = scores(kinds, cloud.attributes["TrueClass"])
    attributes = cloud.attributes | {"Classification": kinds}
    return Cloud(cloud.xyz_m, cloud.origin_m, attributes), facts


def doubts(facts: Mapping[str, Any], threshold_db: float, where: str | Path) -> list[Finding]:
    """A warning where a threshold of reflectance that was not made for a scan makes leaves wood.

    Parameters
    ----------
    facts : mapping
        As of `classify`.
    threshold_db : float
        The threshold [dB].
    where : str or Path
        The cloud, for the message.
    """
    wood = 1.0 - facts["leaf_share"]
    if facts["method"] != "reflectance" or wood <= MOST_WOOD:
        return []
    return [
        findings.warning(
            where,
            f"{wood:.0%} of the points brighter than {threshold_db:g} dB and so taken for wood",
            f"at most {MOST_WOOD:.0%} of a tree in leaf",
            "Leaves may be brighter to this scanner than the threshold: tell leaf from wood by "
            "shape and reflectance together.",
            "classify:\n  method: learned",
        )
    ]


def codes(is_leaf: np.ndarray) -> np.ndarray:
    """(n,) uint8 class codes, 4 for leaf and 0 for wood."""
    return np.where(is_leaf, LEAF, WOOD).astype(np.uint8)


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
    is_leaf = np.asarray(is_leaf)
    wins = np.empty(len(xyz_m), bool)
    for slab in voxel_groups.slabs(voxel_groups.cells(xyz_m[:, 0], voxel_size_m)):
        groups = voxel_groups.group(xyz_m[slab], voxel_size_m)
        leaf_wins = 2 * groups.total(is_leaf[slab]) >= groups.size
        wins[slab] = leaf_wins[groups.voxel_of_point]
    return wins
