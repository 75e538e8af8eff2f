"""Grow the virtual apple tree; its leaf and wood area are the truth of the run."""

from dapple.formats import json, meshes
from dapple.virtual.plants import apple_tree
from dapple.workflow import options, run


def main(snakemake):
    plant = apple_tree(**options(snakemake.params))
    meshes.write_ply(snakemake.output.leaves, plant.leaves)
    meshes.write_ply(snakemake.output.wood, plant.wood)
    json.write(snakemake.output.summary, plant.facts())


if __name__ == "__main__":
    run(main, snakemake)
