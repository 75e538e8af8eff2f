"""Teach what leaf and wood look like in scans, by virtual scans alone."""

import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier

from dapple.cloud import learned
from dapple.cloud.boosted_trees import LEAF, BoostedTrees
from dapple.formats.clouds import WOOD
from dapple.streams import stream_seed
from dapple.virtual import labelled_scans

NODES_OF_A_SCAN = 6_000
"""Of each scan so many nodes are learned from, by chance: large trees count no more than small."""
LEARNING = {
    "max_iter": 120,
    "learning_rate": 0.1,
    "max_leaf_nodes": 31,
    "min_samples_leaf": 50,
    "l2_regularization": 1.0,
    "early_stopping": False,
}
"""Of the gradient boosting."""


def train(trees: int, seed: int) -> dict[str, BoostedTrees]:
    """Scan virtual trees and learn from their nodes.

    Parameters
    ----------
    trees : int
        Number of trees, one scan each.
    seed : int

    Returns
    -------
    dict of str to BoostedTrees
        `with_reflectance`, and `shape` for clouds without; above 0 is wood.
    """
    parts = [rows_of(number, seed) for number in range(trees)]
    is_wood = np.concatenate([wood for _, wood in parts])
    return {
        name: fitted(np.concatenate([rows[name] for rows, _ in parts]), is_wood, seed)
        for name in learned.MODELS
    }


def rows_of(number: int, seed: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Some nodes of a drawn tree: for each model what it is asked, and (n,) whether it is wood."""
    plant, settings = labelled_scans.draw(number, seed)
    cloud = labelled_scans.scan(plant, seed=stream_seed(seed, "scan", number), **settings)
    is_wood = cloud.attributes["TrueClass"] == WOOD
    rows, node = {}, np.zeros(0, np.int64)
    for name, bright in learned.MODELS.items():
        rows[name], node = learned.features(cloud, reflectance=bright)
    share = np.bincount(node, is_wood) / np.bincount(node)
    rng = np.random.default_rng(stream_seed(seed, "nodes", number))
    chosen = rng.permutation(len(share))[:NODES_OF_A_SCAN]
    print(f"tree {number}: {len(cloud)} points, {is_wood.mean():.1%} of them wood", flush=True)
    return {name: found[chosen] for name, found in rows.items()}, share[chosen] > 0.5


def fitted(rows: np.ndarray, positive: np.ndarray, seed: int) -> BoostedTrees:
    """Boost trees that tell rows (n, f) that are positive (n,) from others."""
    model = HistGradientBoostingClassifier(**LEARNING, random_state=seed % 2**32)
    return of_sklearn(model.fit(rows, positive))


def of_sklearn(model: object) -> BoostedTrees:
    """The trees of a fitted `sklearn.ensemble.HistGradientBoostingClassifier` of two classes."""
    trees = [one.nodes for (one,) in model._predictors]  # type: ignore[attr-defined]
    root = np.concatenate([[0], np.cumsum([len(nodes) for nodes in trees])[:-1]])
    nodes = np.concatenate(trees)
    shift = np.repeat(root, [len(tree) for tree in trees])
    is_leaf = nodes["is_leaf"].astype(bool)
    return BoostedTrees(
        np.asarray(model._baseline_prediction, np.float32).ravel(),  # type: ignore[attr-defined]
        root.astype(np.int32),
        np.where(is_leaf, LEAF, nodes["feature_idx"]).astype(np.int16),
        _rounded(nodes["num_threshold"]),
        (nodes["left"] + shift).astype(np.int32),
        (nodes["right"] + shift).astype(np.int32),
        np.where(is_leaf, nodes["value"], 0).astype(np.float32),
    )


def _rounded(threshold: np.ndarray) -> np.ndarray:
    """Thresholds as float32 that part float32 numbers as the given ones do."""
    near = threshold.astype(np.float32)
    # A float32 row is at most x where it is at most the largest float32 that is not above x.
    above = near.astype(np.float64) > threshold
    return np.where(above, np.nextafter(near, np.float32(-np.inf)), near).astype(np.float32)
