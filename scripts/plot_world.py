"""Grow the trees of a virtual plot, place them on their terrain and give them chlorophyll."""

import numpy as np
import pandas as pd

from dapple.formats import geojson, json, meshes, tables
from dapple.streams import stream_seed
from dapple.virtual import conifers, crown_outlines, plot_optics, plots, terrain
from dapple.workflow import options, run


def main(snakemake):
    settings, output = options(snakemake.params), snakemake.output
    seed = settings["seed"]
    ground = terrain.undulating(**settings["terrain"], seed=stream_seed(seed, "terrain"))
    grown = grow(settings, seed)
    outlines = [crown_outlines.outline(tree.leaves.vertices_m) for tree in grown]
    trees = plots.plant(
        outlines,
        np.array([tree.height_m for tree in grown]),
        plots.Sizes(**settings["sizes"]),
        ground,
        **settings["planting"],
        seed=stream_seed(seed, "planting"),
    )
    size_m, margin_m = settings["planting"]["size_m"], settings["planting"]["margin_m"]
    trees["sampled"] = plots.sample(
        trees, size_m, settings["field_trees"], stream_seed(seed, "sampled")
    )
    trees = trees.join(needles(len(trees), settings, seed))
    rings = plots.rings(trees, outlines)
    for k, tree in enumerate(grown):
        meshes.write_ply(output.leaves[k], tree.leaves)
        meshes.write_ply(output.wood[k], tree.wood)
    high_m = np.asarray(size_m) + margin_m
    mesh = ground.mesh(np.full(2, -margin_m), high_m, settings["terrain_step_m"])
    meshes.write_ply(output.terrain, mesh, settings["origin_m"])
    write(trees, rings, settings, output)
    facts = describe(trees, grown, rings, size_m)
    json.write(output.summary, facts | {"world_origin_m": settings["origin_m"]})
    print(facts)


def grow(settings, seed):
    """The trees that all others are copies of: as large as the mean tree."""
    sizes = settings["sizes"]
    area_m2 = settings["crown_leaf_area_index"] * np.pi * sizes["crown_radius_m"] ** 2
    found = []
    for k in range(settings["grown_trees"]):
        tree = conifers.grow(
            settings["species"],
            height_m=sizes["height_m"],
            crown_radius_m=sizes["crown_radius_m"],
            leaf_area_m2=area_m2,
            **settings["tree"],
            seed=stream_seed(seed, "tree", k),
        )
        found.append(tree)
    return found


def needles(n, settings, seed):
    """Chemistry of the needles of n trees."""
    columns = {
        "lcc_ug_cm2": plot_optics.chlorophyll(n, **settings["lcc"], seed=stream_seed(seed, "lcc"))
    }
    rng = np.random.default_rng(stream_seed(seed, "needles"))
    for name, least in (("structure_n", 1.0), ("dry_matter_g_cm2", 0.0), ("brown", 0.0)):
        mean, sd = settings[name]
        columns[name] = np.maximum(mean + sd * np.clip(rng.standard_normal(n), -2, 2), least)
    return pd.DataFrame(columns)


def write(trees, rings, settings, output):
    """Tables of the trees in world coordinates, and outlines of those that were sampled."""
    world = trees.copy()
    world[["x_m", "y_m", "z_m"]] += settings["origin_m"]
    tables.write(output.trees, world, "%.10g")
    chosen = np.flatnonzero(trees.sampled)
    crowns = geojson.of_rings(
        [rings[k] + np.asarray(settings["origin_m"][:2]) for k in chosen],
        trees.tree.to_numpy()[chosen],
        trees.lcc_ug_cm2.to_numpy()[chosen],
        settings["crs"],
    )
    geojson.write(output.crowns, crowns)


def describe(trees, grown, rings, size_m):
    """What the plot is like."""
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


if __name__ == "__main__":
    run(main, snakemake)
