"""Trees of a virtual plot: those that others are copies of, their chemistry, their sums."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from dapple.streams import stream_seed
from dapple.virtual import conifers, plot_optics, plots
from dapple.virtual.conifers import Conifer


def grow(
    species: str,
    number: int,
    *,
    height_m: float,
    crown_radius_m: float,
    crown_leaf_area_index: float,
    tree: Mapping[str, Any],
    seed: int,
) -> list[Conifer]:
    """Grow the trees that all others are copies of, as large as the mean tree.

    Parameters
    ----------
    species, tree
        As in `conifers.grow`.
    number : int
        How many.
    height_m, crown_radius_m : float
    crown_leaf_area_index : float
        One-sided leaf area over the area of the crown's outline.
    seed : int
    """
    area_m2 = crown_leaf_area_index * np.pi * crown_radius_m**2
    return [
        conifers.grow(
            species,
            height_m=height_m,
            crown_radius_m=crown_radius_m,
            leaf_area_m2=area_m2,
            **tree,
            seed=stream_seed(seed, "tree", k),
        )
        for k in range(number)
    ]


def chemistry(
    n: int,
    *,
    lcc: Mapping[str, Any],
    others: Mapping[str, tuple[float, float]],
    seed: int,
) -> pd.DataFrame:
    """Chemistry of the needles of n trees.

    Parameters
    ----------
    n : int
    lcc : mapping
        Of `plot_optics.chlorophyll`.
    others : mapping of str to (float, float)
        Mean and standard deviation over trees of all but chlorophyll: `structure_n`, 1 or more,
        `dry_matter_g_cm2`, `brown`, `chlorophyll_per_carotenoid`, `water_cm`.
    seed : int
    """
    columns = {"lcc_ug_cm2": plot_optics.chlorophyll(n, **lcc, seed=stream_seed(seed, "lcc"))}
    rng = np.random.default_rng(stream_seed(seed, "needles"))
    for name, (mean, sd) in others.items():
        least = 1.0 if name == "structure_n" else 0.0
        columns[name] = np.maximum(mean + sd * np.clip(rng.standard_normal(n), -2, 2), least)
    return pd.DataFrame(columns)


def describe(
    trees: pd.DataFrame,
    grown: Sequence[Conifer],
    rings: list[np.ndarray],
    size_m: tuple[float, float],
) -> dict[str, float]:
    """What a plot is like, for its summary file.

    Parameters
    ----------
    trees : DataFrame
        As `plots.plant` gives it, with chlorophyll and `sampled`.
    grown : sequence of Conifer
    rings : list of (k, 2) float64
        Outlines of all crowns.
    size_m : (float, float)
    """
    leaf_m2 = plots.stretched_area_m2([tree.leaves for tree in grown], trees)
    faces = [len(tree.leaves.faces) + len(tree.wood.faces) for tree in grown]
    inside = trees.inside.to_numpy()
    return {
        "n_trees": len(trees),
        "n_inside": int(inside.sum()),
        "n_sampled": int(trees.sampled.sum()),
        "cover": plots.cover(rings, size_m),
        "leaf_area_index": float(leaf_m2[inside].sum() / np.prod(size_m)),
        "leaf_area_m2": float(leaf_m2.sum()),
        "wood_area_m2": float(plots.stretched_area_m2([t.wood for t in grown], trees).sum()),
        "n_triangles": int(sum(faces[k] for k in trees.grown)),
        "lcc_mean_ug_cm2": float(trees.lcc_ug_cm2.mean()),
        "lcc_sd_ug_cm2": float(trees.lcc_ug_cm2.std()),
        "mean_height_m": float(trees.height_m.mean()),
        "mean_crown_radius_m": float(trees.crown_radius_m.mean()),
    }
