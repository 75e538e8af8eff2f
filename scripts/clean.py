"""Filter noise and leave one point a voxel."""

from dapple.cloud.clean import clean
from dapple.formats import clouds, json
from dapple.workflow import options, run


def main(snakemake):
    path = snakemake.input.points
    cloud, counts = clean(clouds.read(path), where=path, **options(snakemake.params))
    clouds.write(snakemake.output.cloud, cloud)
    json.write(snakemake.output.counts, counts)


if __name__ == "__main__":
    run(main, snakemake)
