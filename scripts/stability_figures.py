"""The map of where reconstructions fail, and its curves."""

from dapple.figures import stability_map, style
from dapple.formats import tables
from dapple.workflow import run


def main(snakemake):
    points = tables.read(snakemake.input.points)
    style.save_both(stability_map.heat_map(points), snakemake.output.map)
    style.save_both(stability_map.curves(points), snakemake.output.curves)


if __name__ == "__main__":
    run(main, snakemake)
