"""All runs in one table, with the verdict on each; where methods fail; the published findings."""

import pandas as pd

from dapple.formats.atomic import atomic
from dapple.stability import thresholds, training, verdict
from dapple.workflow import run

TEXT = {"label": str, "failed": str}


def main(snakemake):
    outputs = snakemake.output
    points = pd.concat(
        [pd.read_csv(path, dtype=TEXT) for path in snakemake.input.batches], ignore_index=True
    )
    points = thresholds.against_harmless(points)
    if snakemake.input.model:
        points["flagged"] = training.flagged(points, verdict.load(snakemake.input.model))
    tables = {
        outputs.points: points,
        outputs.thresholds: thresholds.table(points),
        outputs.published: thresholds.published(points),
    }
    for path, table in tables.items():
        with atomic(path) as partial:
            table.to_csv(partial, index=False, float_format="%.6g")
    print(f"{len(points)} runs, {points['r'].isna().sum()} of them without a result")


if __name__ == "__main__":
    run(main, snakemake)
