"""The map of where methods fail, and its curves."""

import pandas as pd

from dapple.figures import stability_map, style
from dapple.workflow import run


def main(snakemake):
    points = pd.read_csv(snakemake.input.points, dtype={"label": str})
    style.save(stability_map.heat_map(points), snakemake.output.map)
    style.save(stability_map.curves(points), snakemake.output.curves)


if __name__ == "__main__":
    run(main, snakemake)
