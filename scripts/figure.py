"""A figure of the report, drawn by the module that the rule names."""

from importlib import import_module

from dapple.figures import style
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    drawing = import_module(f"dapple.figures.{params.drawn_by}")
    figure = drawing.of_run(snakemake.input, params.options)
    for path in snakemake.output:
        style.save(figure, path)


if __name__ == "__main__":
    run(main, snakemake)
