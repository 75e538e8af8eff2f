"""Accuracy against speed as a page to explore."""

from dapple.figures import pareto_chart
from dapple.formats import tables
from dapple.formats.atomic import atomic
from dapple.workflow import run


def main(snakemake):
    points = tables.read(snakemake.input.points)
    title = f"{snakemake.params.experiment}: accuracy against speed"
    with atomic(snakemake.output.page) as partial:
        partial.write_text(pareto_chart.page(points, title), encoding="utf-8")


if __name__ == "__main__":
    run(main, snakemake)
