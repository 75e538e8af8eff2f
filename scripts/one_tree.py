"""Take one tree out of a plot; its neighbours stay as shade."""

import numpy as np

from dapple.cloud import trees
from dapple.formats import clouds, ground_surface, json, meshes, tables
from dapple.structure import polygons
from dapple.workflow import options, run


def main(snakemake):
    params, output = snakemake.params, snakemake.output
    cloud = clouds.read(snakemake.input.points)
    ground = ground_surface.read(snakemake.input.ground)
    plot = trees.divide(cloud, ground)
    chosen = trees.choose(
        plot.stems, cloud.origin_m, at_m=params.at, number=params.id, where=snakemake.input.points
    )
    clouds.write(output.points, cloud.select(plot.tree == chosen))
    near = trees.neighbours(plot, chosen, within_m=params.neighbours_m)
    shade = cloud.xyz_m[np.isin(plot.tree, near)]
    meshes.write_ply(output.neighbours, _coarse(shade, options(params)), cloud.origin_m)
    tables.write(output.stems, plot.stems)
    json.write(output.tree, trees.describe(plot, chosen, near, cloud.origin_m))


def _coarse(xyz_m, settings):
    """Polygons of the neighbours, all of them taken for leaves; none where there are none."""
    if not len(xyz_m):
        return meshes.empty()
    return polygons.reconstruct(
        xyz_m,
        voxel_size_m=settings["neighbour_voxel_m"],
        buffer_m=settings["buffer_m"],
        mitre_limit=settings["mitre_limit"],
        seed=settings["seed"],
        what="neighbours",
    )


if __name__ == "__main__":
    run(main, snakemake)
