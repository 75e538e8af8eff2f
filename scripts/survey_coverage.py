"""How well a real scan covers its surroundings, and how much canopy it leaves unknown."""

import pandas as pd

from dapple.formats import json, shots
from dapple.formats.atomic import atomic
from dapple.survey import coverage
from dapple.workflow import options, run


def main(snakemake):
    path = snakemake.input.shots
    classes, summary = coverage.of_shots(lambda: shots.iterate(path), **options(snakemake.params))
    with atomic(snakemake.output.classes) as partial:
        pd.DataFrame(classes).to_csv(partial, index=False, float_format="%.6g")
    json.write(snakemake.output.summary, summary)


if __name__ == "__main__":
    run(main, snakemake)
