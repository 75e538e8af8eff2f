"""Correlation of every sensor by reconstruction; simulated against measured PAR."""

from dapple.figures import boxplot, scatter, style
from dapple.formats import tables
from dapple.workflow import run


def main(snakemake):
    inputs = snakemake.input
    overall, per_sensor, records = (
        tables.read(path) for path in (inputs.overall, inputs.per_sensor, inputs.records)
    )
    unseen = records[records["part"] == "reporting"]
    style.save(boxplot.draw(per_sensor, overall), snakemake.output.boxplot)
    style.save(scatter.draw(unseen, overall), snakemake.output.scatter)


if __name__ == "__main__":
    run(main, snakemake)
