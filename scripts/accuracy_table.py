"""Put the scores of all plots, models and masks into one table, and one map beside it."""

import shutil

import pandas as pd

from dapple.formats import tables
from dapple.formats.atomic import atomic
from dapple.workflow import run


def main(snakemake):
    table = pd.concat([tables.read(path) for path in snakemake.input.accuracy])
    tables.write(snakemake.output.accuracy, table)
    with atomic(snakemake.output.map) as partial:
        shutil.copyfile(snakemake.input.map, partial)
    print(table[table["seed"] == "mean"].to_string(index=False))


if __name__ == "__main__":
    run(main, snakemake)
