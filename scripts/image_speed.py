"""Put the comparisons of all plots together."""

import pandas as pd

from dapple.formats import tables
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    for paths, output in (
        (snakemake.input.speed, snakemake.output.speed),
        (snakemake.input.comparison, snakemake.output.comparison),
    ):
        parts = [
            tables.read(path).assign(plot=plot)
            for plot, path in zip(params.plots, paths, strict=True)
        ]
        table = pd.concat(parts)
        tables.write(output, table[["plot", *table.columns[:-1]]], None)
        print(table.to_string())


if __name__ == "__main__":
    run(main, snakemake)
