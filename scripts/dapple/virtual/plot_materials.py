"""What every triangle of a virtual plot is made of."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from dapple.formats.meshes import Mesh, concatenate
from dapple.optics.cameras import Camera
from dapple.optics.default_spectra import CONIFER_BARK
from dapple.virtual import plot_optics, plots
from dapple.virtual.plot_optics import Materials


def assemble(
    trees: pd.DataFrame,
    grown_leaves: Sequence[Mesh],
    grown_wood: Sequence[Mesh],
    terrain: Mesh,
    camera: Camera,
    *,
    lowest_to_highest_lcc: float,
    lcc_layers: int,
    water_cm: float,
    ground: Mapping[str, Any],
    ground_seed: int,
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
    lowest_to_highest_lcc : float
        Chlorophyll of the lowest layer of a crown over that of the highest.
    lcc_layers : int
        Layers of a crown, each with its own chlorophyll.
    water_cm : float
        Of the needles.
    ground : mapping
        Of `plot_optics.ground_patches`.
    ground_seed : int
    """
    leaves, _ = plots.place(list(grown_leaves), trees)
    wood, _ = plots.place(list(grown_wood), trees)
    n_layers = lcc_layers if lowest_to_highest_lcc != 1 else 1
    (reflectance, transmittance), of_leaf = _needles(
        grown_leaves, trees, camera, n_layers, lowest_to_highest_lcc, water_cm
    )
    bark = plot_optics.in_bands(CONIFER_BARK, camera)
    centres = terrain.vertices_m[terrain.faces, :2].mean(axis=1)
    soil = plot_optics.ground_patches(centres, camera, **ground, seed=ground_seed)
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
    n_layers: int,
    ratio: float,
    water_cm: float,
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Optics (trees x layers, bands) of needles, and the row of every shoot of the plot."""
    layer = [plot_optics.layers(mesh, n_layers) for mesh in grown]
    factor = [
        plot_optics.layer_factor(own, mesh.element_area_m2, n_layers, ratio)
        for own, mesh in zip(layer, grown, strict=True)
    ]
    lcc = np.concatenate([factor[tree.grown] * tree.lcc_ug_cm2 for tree in trees.itertuples()])
    of_tree = np.repeat(np.arange(len(trees)), n_layers)
    chemistry = {
        name: trees[name].to_numpy()[of_tree]
        for name in ("structure_n", "dry_matter_g_cm2", "brown")
    }
    rows = [row * n_layers + layer[tree.grown] for row, tree in enumerate(trees.itertuples())]
    return plot_optics.needles(lcc, camera, water_cm=water_cm, **chemistry), np.concatenate(rows)
