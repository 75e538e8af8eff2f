"""Teach the learned classifier anew from virtual scans."""

from dapple.cloud import boosted_trees
from dapple.virtual.leaf_wood_training import train
from dapple.workflow import options, run


def main(snakemake):
    boosted_trees.write(snakemake.output.model, train(**options(snakemake.params)))


if __name__ == "__main__":
    run(main, snakemake)
