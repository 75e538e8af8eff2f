"""Grow the trees of a virtual plot, place them on their terrain and give them chlorophyll."""

import numpy as np

from dapple.formats import json, meshes, tables, vectors
from dapple.streams import stream_seed
from dapple.virtual import crown_outlines, plot_trees, plots, terrain
from dapple.workflow import options, run


def main(snakemake):
    settings, output = options(snakemake.params), snakemake.output
    seed = settings["seed"]
    ground = terrain.undulating(**settings["terrain"], seed=stream_seed(seed, "terrain"))
    sizes = settings["sizes"]
    grown = plot_trees.grow(
        settings["species"],
        settings["grown_trees"],
        height_m=sizes["height_m"],
        crown_radius_m=sizes["crown_radius_m"],
        crown_leaf_area_index=settings["crown_leaf_area_index"],
        tree=settings["tree"],
        seed=seed,
    )
    outlines = [crown_outlines.outline(tree.leaves.vertices_m) for tree in grown]
    trees = plots.plant(
        outlines,
        np.array([tree.height_m for tree in grown]),
        plots.Sizes(**sizes),
        ground,
        **settings["planting"],
        seed=stream_seed(seed, "planting"),
    )
    size_m, margin_m = settings["planting"]["size_m"], settings["planting"]["margin_m"]
    trees["sampled"] = plots.sample(
        trees, size_m, settings["field_trees"], stream_seed(seed, "sampled")
    )
    chemistry = plot_trees.chemistry(
        len(trees), lcc=settings["lcc"], others=settings["chemistry"], seed=seed
    )
    trees = trees.join(chemistry)
    rings = plots.rings(trees, outlines)
    for k, tree in enumerate(grown):
        meshes.write_ply(output.leaves[k], tree.leaves)
        meshes.write_ply(output.wood[k], tree.wood)
    high_m = np.asarray(size_m) + margin_m
    mesh = ground.mesh(np.full(2, -margin_m), high_m, settings["terrain_step_m"])
    meshes.write_ply(output.terrain, mesh, settings["origin_m"])
    write(trees, rings, settings, output)
    facts = plot_trees.describe(trees, grown, rings, size_m)
    json.write(output.summary, facts | {"world_origin_m": settings["origin_m"]})
    print(facts)


def write(trees, rings, settings, output):
    """Tables of the trees in world coordinates, and outlines of those that were sampled."""
    world = trees.copy()
    world[["x_m", "y_m", "z_m"]] += settings["origin_m"]
    tables.write(output.trees, world, "%.10g")
    chosen = np.flatnonzero(trees.sampled)
    crowns = vectors.of_rings(
        [rings[k] + np.asarray(settings["origin_m"][:2]) for k in chosen],
        trees.tree.to_numpy()[chosen],
        trees.lcc_ug_cm2.to_numpy()[chosen],
        settings["crs"],
    )
    vectors.write(output.crowns, crowns)


if __name__ == "__main__":
    run(main, snakemake)
