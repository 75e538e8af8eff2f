"""Accuracy against speed: the chart of the trade-off as PNG and as HTML."""

import pandas as pd

from dapple.figures import style, tradeoff
from dapple.formats.atomic import atomic
from dapple.workflow import run


def main(snakemake):
    points = pd.read_csv(snakemake.input.points)
    style.save(tradeoff.draw(points), snakemake.output.chart)
    title = f"{snakemake.params.experiment}: accuracy against speed"
    with atomic(snakemake.output.page) as partial:
        partial.write_text(tradeoff.page(points, title), encoding="utf-8")


if __name__ == "__main__":
    run(main, snakemake)
