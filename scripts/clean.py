"""Filter noise and leave one point a voxel."""

from dapple.cloud.clean import clean
from dapple.formats import json
from dapple.workflow import options, run


def main(snakemake):
    settings = options(snakemake.params)
    settings.pop("distance_points")
    counts = clean(snakemake.input.points, snakemake.output.cloud, **settings)
    json.write(snakemake.output.counts, counts)


if __name__ == "__main__":
    run(main, snakemake)
