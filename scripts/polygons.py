"""Reconstruct one planar polygon per voxel, separately for leaf and wood."""

from dapple.formats import clouds, json, meshes
from dapple.formats.clouds import LEAF, WOOD
from dapple.structure import summary
from dapple.structure.polygons import reconstruct
from dapple.workflow import options, run


def main(snakemake):
    cloud = clouds.read(snakemake.input.cloud)
    kinds = cloud.attributes["Classification"]
    settings = options(snakemake.params)
    leaves = reconstruct(cloud.xyz_m[kinds == LEAF], what="leaf", **settings)
    wood = reconstruct(cloud.xyz_m[kinds == WOOD], what="wood", **settings)
    meshes.write_ply(snakemake.output.leaves, leaves)
    meshes.write_ply(snakemake.output.wood, wood)
    truth = json.read(snakemake.input.truth) if snakemake.input.truth else None
    json.write(snakemake.output.summary, summary.of_meshes(leaves, wood, truth))


if __name__ == "__main__":
    run(main, snakemake)
