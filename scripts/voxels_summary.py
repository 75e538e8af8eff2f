"""Areas in voxels, and of the wood that stands in them."""

from dapple.formats import json, meshes, voxel_grids
from dapple.structure.summary import of_voxels
from dapple.workflow import run


def main(snakemake):
    inputs = snakemake.input
    wood = meshes.read_ply(inputs.wood) if inputs.wood else None
    truth = json.read(inputs.truth) if inputs.truth else None
    json.write(snakemake.output.summary, of_voxels(voxel_grids.read(inputs.voxels), wood, truth))


if __name__ == "__main__":
    run(main, snakemake)
