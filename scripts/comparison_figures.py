"""Correlation of every sensor by reconstruction; simulated against measured PAR."""

import pandas as pd

from dapple.figures import boxplot, scatter, style
from dapple.workflow import run


def main(snakemake):
    inputs = snakemake.input
    overall, per_sensor = (
        pd.read_csv(path, dtype={"sensor": str}) for path in (inputs.overall, inputs.per_sensor)
    )
    records = pd.read_csv(inputs.records, parse_dates=["time"], dtype={"sensor": str})
    unseen = records[records["part"] == "reporting"]
    style.save(boxplot.draw(per_sensor, overall), snakemake.output.boxplot)
    style.save(scatter.draw(unseen, overall), snakemake.output.scatter)


if __name__ == "__main__":
    run(main, snakemake)
