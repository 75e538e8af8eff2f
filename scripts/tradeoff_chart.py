"""Accuracy against speed: the chart of the trade-off as PNG and as HTML."""

from dapple.figures import pareto_chart, style
from dapple.formats import tables
from dapple.formats.atomic import atomic
from dapple.workflow import run


def main(snakemake):
    points = tables.read(snakemake.input.points)
    style.save(pareto_chart.draw(points), snakemake.output.chart)
    title = f"{snakemake.params.experiment}: accuracy against speed"
    with atomic(snakemake.output.page) as partial:
        partial.write_text(pareto_chart.page(points, title), encoding="utf-8")


if __name__ == "__main__":
    run(main, snakemake)
