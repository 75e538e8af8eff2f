"""All runs in one table with the verdict on each; where they fail; the published findings."""

import pandas as pd

from dapple.formats import tables
from dapple.stability import thresholds
from dapple.verdict import fitting, judgement
from dapple.workflow import run

ENOUGH = 500
"""Rows from which a half of them can teach the verdict on the other."""


def main(snakemake):
    outputs = snakemake.output
    points = pd.concat([tables.read(path) for path in snakemake.input.batches], ignore_index=True)
    points = thresholds.against_harmless(points)
    for column, with_records in (("flagged", True), ("flagged_scan", False)):
        points[column] = judged(points, snakemake.input.model, with_records)
    found = {
        outputs.points: points,
        outputs.thresholds: thresholds.table(points),
        outputs.published: thresholds.published(points),
    }
    for path, table in found.items():
        tables.write(path, table)
    print(f"{len(points)} runs, {points['r'].isna().sum()} of them without a result")


def judged(points, model, with_records):
    """Verdicts by models that were not fitted to the run judged; a few runs by the stored ones."""
    if len(points) >= ENOUGH:
        return fitting.cross_flagged(points, with_records=with_records)
    return (
        fitting.flagged(points, judgement.load(model, with_records=with_records)) if model else ""
    )


if __name__ == "__main__":
    run(main, snakemake)
