"""What every triangle of a virtual plot is made of."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from dapple.formats.meshes import Mesh, concatenate
from dapple.optics.cameras import Camera
from dapple.optics.default_spectra import CONIFER_BARK
from dapple.streams import stream_seed
from dapple.virtual import plot_optics, plots
from dapple.virtual.plot_optics import Materials


def assemble(
    trees: pd.DataFrame,
    grown_leaves: Sequence[Mesh],
    grown_wood: Sequence[Mesh],
    terrain: Mesh,
    camera: Camera,
    *,
    crown: Mapping[str, Any],
    ground: Mapping[str, Any],
    seed: int,
) -> tuple[Mesh, Materials]:
    """The plot as one mesh, and what every triangle is made of.

    Parameters
    ----------
    trees : DataFrame
        Local frame; `grown` says which of the grown trees each is a copy of.
    grown_leaves, grown_wood : sequence of Mesh
        Of the trees that all others are copies of.
    terrain : Mesh
    camera : Camera
        For whose bands.
    crown : mapping
        `lowest_to_highest_lcc`: chlorophyll of the lowest layer of a crown over that of the
        highest; `lcc_layers`; `leaves_per_layer`, kinds of shoots in each layer; and
        `within_tree_sd`, their standard deviation of chlorophyll and dry matter as a share.
    ground : mapping
        Of `plot_optics.ground_patches`.
    seed : int
        Of the kinds of shoots and of the ground.
    """
    leaves, _ = plots.place(list(grown_leaves), trees)
    wood, _ = plots.place(list(grown_wood), trees)
    (reflectance, transmittance), of_leaf = _needles(
        grown_leaves, trees, camera, crown, np.random.default_rng(stream_seed(seed, "shoots"))
    )
    bark = plot_optics.in_bands(CONIFER_BARK, camera)
    centres = terrain.vertices_m[terrain.faces, :2].mean(axis=1)
    soil = plot_optics.ground_patches(centres, camera, **ground, seed=stream_seed(seed, "ground"))
    n = len(reflectance)
    of_face = [
        of_leaf[leaves.element],
        np.full(len(wood.faces), n),
        n + 1 + np.arange(len(terrain.faces)),
    ]
    materials = Materials(
        np.concatenate([reflectance, bark[None], soil]),
        np.concatenate([transmittance, np.zeros((1 + len(soil), len(bark)))]),
        np.concatenate(of_face).astype(np.int32),
    )
    return concatenate([leaves, wood, terrain]), materials


def _needles(
    grown: Sequence[Mesh],
    trees: pd.DataFrame,
    camera: Camera,
    crown: Mapping[str, Any],
    rng: np.random.Generator,
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Optics (trees x parts, bands) of needles, and the row of every shoot of the plot."""
    shape = crown["lcc_layers"], crown["leaves_per_layer"]
    part = [
        plot_optics.layers(mesh, shape[0]) * shape[1] + rng.integers(0, shape[1], mesh.n_elements)
        for mesh in grown
    ]
    lcc, dry_matter = [], []
    for tree in trees.itertuples():
        own = part[tree.grown], grown[tree.grown].element_area_m2
        deviation = crown["within_tree_sd"] * np.clip(rng.standard_normal((2, *shape)), -2, 2)
        ratio = crown["lowest_to_highest_lcc"]
        lcc.append(tree.lcc_ug_cm2 * plot_optics.part_factor(*own, deviation[0], ratio))
        factor = plot_optics.part_factor(*own, deviation[1], 1.0)
        dry_matter.append(tree.dry_matter_g_cm2 * factor)
    n_parts = shape[0] * shape[1]
    of_tree = np.repeat(np.arange(len(trees)), n_parts)
    others = {
        name: trees[name].to_numpy()[of_tree]
        for name in ("structure_n", "brown", "chlorophyll_per_carotenoid", "water_cm")
    }
    optics = plot_optics.needles(
        np.concatenate(lcc), camera, dry_matter_g_cm2=np.concatenate(dry_matter), **others
    )
    rows = [row * n_parts + part[tree.grown] for row, tree in enumerate(trees.itertuples())]
    return optics, np.concatenate(rows)
