"""Leaf or wood by what virtual scans have taught of neighbourhoods at several scales."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dapple.cloud import boosted_trees, eigenvalues, voxel_groups
from dapple.errors import EmptyCloudError
from dapple.formats.clouds import Cloud
from dapple.progress import followed

MODEL = Path(__file__).with_name("leaf_wood_model.npz")
NODE_M = 0.015
"""Points within a voxel of this size are looked at together [m]."""
EDGES_M = (0.02, 0.04, 0.08, 0.16, 0.32)
"""Voxels whose neighbourhoods are looked at; these are three of them wide [m]."""
LEAST_POINTS = 50
MODELS = {"with_reflectance": True, "shape": False}
"""Of the file, and whether they look at reflectance."""


def learned(
    cloud: Cloud, settings: Mapping[str, Any], seed: int
) -> tuple[np.ndarray, dict[str, float]]:
    """Leaf or wood by a model, with reflectance where all points have it."""
    rows, node_of_point = features(cloud)
    model = boosted_trees.read(settings.get("model") or MODEL, model_for(cloud))
    is_leaf = model.log_odds(rows) <= 0
    return is_leaf[node_of_point], {"with_reflectance": float(has_reflectance(cloud))}


def has_reflectance(cloud: Cloud) -> bool:
    """Whether all points have a reflectance, and not all the same."""
    values = cloud.attributes.get("Reflectance")
    return values is not None and bool(np.isfinite(values).all()) and bool(np.ptp(values) > 0)


def model_for(cloud: Cloud) -> str:
    """Name of the model that can judge a cloud."""
    return "with_reflectance" if has_reflectance(cloud) else "shape"


def features(cloud: Cloud, *, reflectance: bool | None = None) -> tuple[np.ndarray, np.ndarray]:
    """What the model is asked about every node.

    Parameters
    ----------
    cloud : Cloud
        Cleaned, in metres; where it stands and how high does not matter.
    reflectance : bool or None
        Whether reflectance counts; None: where all points have it.

    Returns
    -------
    rows : (k, f) float32
        Of each scale, `eigenvalues.COLUMNS`. With reflectance also its mean, deviation and
        maximum at each scale and the node's own, from the median of the cloud in half distances
        between its quartiles.
    node_of_point : (n,) int64

    Raises
    ------
    EmptyCloudError
        Fewer than 50 points.
    """
    if len(cloud) < LEAST_POINTS:
        raise EmptyCloudError(
            "point cloud",
            f"{len(cloud)} points",
            f"at least {LEAST_POINTS} points of a tree",
            "Check the filters before.",
        )
    reflectance = has_reflectance(cloud) if reflectance is None else reflectance
    groups = voxel_groups.group(cloud.xyz_m - cloud.xyz_m.min(axis=0), NODE_M)
    nodes_m = groups.total(cloud.xyz_m - cloud.xyz_m.min(axis=0)) / groups.size[:, None]
    brightness = np.zeros((len(nodes_m), 0))
    if reflectance:
        values = cloud.attributes["Reflectance"].astype(np.float64)
        low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
        brightness = groups.total((values - middle) / max(0.5 * (high - low), 1e-3))[:, None]
        brightness = brightness / groups.size[:, None]
    columns = [brightness]
    for edge_m in followed(EDGES_M, "sizes of neighbourhoods"):
        found = eigenvalues.around(nodes_m, edge_m, brightness)
        rows = [found.shape, found.mean, found.deviation, found.largest]
        columns.append(np.concatenate(rows, axis=1)[found.voxel_of_point])
    return np.concatenate(columns, axis=1).astype(np.float32), groups.voxel_of_point
