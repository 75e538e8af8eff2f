"""Render the images that a UAV's camera takes of a virtual plot."""

import resource
import time

import numpy as np

from dapple.formats import json, meshes, rasters, tables
from dapple.formats.meshes import concatenate
from dapple.formats.rasters import Raster
from dapple.optics.bands import CAMERA_NM
from dapple.streams import stream_seed
from dapple.virtual import camera, plot_optics, plots
from dapple.virtual.plot_optics import Materials
from dapple.workflow import options, run


def main(snakemake):
    settings, inputs = options(snakemake.params), snakemake.input
    begun, seed = time.perf_counter(), settings["seed"]
    origin_m = np.asarray(settings["origin_m"], float)
    trees = tables.read(inputs.trees)
    trees[["x_m", "y_m", "z_m"]] -= origin_m
    world, materials = assemble(inputs, trees, settings)
    scene = camera.build(world, materials)
    print(f"{len(world.faces)} triangles, {len(materials.reflectance)} materials")
    del world
    built = time.perf_counter()
    view = camera.Camera.over(settings["size_m"], settings["pixel_m"])
    image = camera.photograph(scene, view, **settings["light"], seed=stream_seed(seed, "paths"))
    image = camera.with_noise(image, **settings["noise"], seed=stream_seed(seed, "noise"))
    rasters.write(
        snakemake.output.images,
        Raster(
            image,
            origin_m[0] + view.left_m,
            origin_m[1] + view.top_m,
            view.pixel_m,
            settings["crs"],
            tuple(f"{centre:.0f}" for centre in CAMERA_NM),
        ),
    )
    facts = {
        "rows": view.rows,
        "columns": view.columns,
        "mean_reflectance": image.mean(axis=(1, 2)).astype(float),
        "build_s": built - begun,
        "trace_s": time.perf_counter() - built,
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    json.write(snakemake.output.summary, facts)
    print(facts)


def assemble(inputs, trees, settings):
    """The world as one mesh, and what every triangle is made of."""
    grown = [meshes.read_ply(path) for path in inputs.leaves]
    leaves, _ = plots.place(grown, trees)
    wood, _ = plots.place([meshes.read_ply(path) for path in inputs.wood], trees)
    ground = meshes.read_ply(inputs.terrain)
    (reflectance, transmittance), of_leaf = needles(grown, trees, settings)
    bark = plot_optics.table_in_bands(plot_optics.BARK_NM, plot_optics.BARK)
    centres = ground.vertices_m[ground.faces, :2].mean(axis=1)
    soil = plot_optics.ground_patches(
        centres, **settings["ground"], seed=stream_seed(settings["seed"], "ground")
    )
    n = len(reflectance)
    of_face = [
        of_leaf[leaves.element],
        np.full(len(wood.faces), n),
        n + 1 + np.arange(len(ground.faces)),
    ]
    materials = Materials(
        np.concatenate([reflectance, bark[None], soil]),
        np.concatenate([transmittance, np.zeros((1 + len(soil), len(bark)))]),
        np.concatenate(of_face).astype(np.int32),
    )
    return concatenate([leaves, wood, ground]), materials


def needles(grown, trees, settings):
    """Optics (trees x layers, bands) of needles, and the row of every shoot of the plot."""
    ratio = settings["lowest_to_highest_lcc"]
    n_layers = settings["lcc_layers"] if ratio != 1 else 1
    layer = [plot_optics.layers(mesh, n_layers) for mesh in grown]
    factor = [
        plot_optics.layer_factor(own, mesh.element_area_m2, n_layers, ratio)
        for own, mesh in zip(layer, grown, strict=True)
    ]
    lcc = np.concatenate([factor[tree.grown] * tree.lcc_ug_cm2 for tree in trees.itertuples()])
    of_tree = np.repeat(np.arange(len(trees)), n_layers)
    optics = plot_optics.needles(
        lcc,
        water_cm=settings["water_cm"],
        **{
            name: trees[name].to_numpy()[of_tree]
            for name in ("structure_n", "dry_matter_g_cm2", "brown")
        },
    )
    rows = [row * n_layers + layer[tree.grown] for row, tree in enumerate(trees.itertuples())]
    return optics, np.concatenate(rows)


if __name__ == "__main__":
    run(main, snakemake)
