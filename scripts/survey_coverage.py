"""How well a real scan covers its surroundings, and how much canopy it leaves unknown."""

import pandas as pd

from dapple.formats import json, shots, tables
from dapple.survey import coverage
from dapple.workflow import options, run


def main(snakemake):
    path = snakemake.input.shots
    classes, summary = coverage.of_shots(lambda: shots.iterate(path), **options(snakemake.params))
    tables.write(snakemake.output.classes, pd.DataFrame(classes))
    json.write(snakemake.output.summary, summary)


if __name__ == "__main__":
    run(main, snakemake)
