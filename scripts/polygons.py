"""Reconstruct one planar polygon per voxel, separately for leaf and wood."""

from dapple.formats import clouds, json, meshes, voxel_grids
from dapple.formats.clouds import LEAF, WOOD
from dapple.structure import occlusion, summary
from dapple.structure.polygons import reconstruct
from dapple.structure.subvoxel_clumping import as_estimated
from dapple.workflow import options, run


def main(snakemake):
    cloud = clouds.read(snakemake.input.cloud)
    kinds = cloud.attributes["Classification"]
    settings = options(snakemake.params)
    correction = settings.pop("correction")
    leaves = reconstruct(cloud.xyz_m[kinds == LEAF], what="leaf", **settings)
    wood = reconstruct(cloud.xyz_m[kinds == WOOD], what="wood", **settings)
    found = leaves.n_elements
    if correction:
        grid = as_estimated(voxel_grids.read(snakemake.input.voxels))
        leaves = occlusion.correct(leaves, grid, seed=settings["seed"], **correction)
    meshes.write_ply(snakemake.output.leaves, leaves)
    meshes.write_ply(snakemake.output.wood, wood)
    truth = json.read(snakemake.input.truth) if snakemake.input.truth else None
    facts = summary.of_meshes(leaves, wood, truth) | {"n_added": leaves.n_elements - found}
    json.write(snakemake.output.summary, facts)


if __name__ == "__main__":
    run(main, snakemake)
