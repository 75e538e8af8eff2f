"""One self-contained page that tells the run."""

from pathlib import Path

from dapple.figures import report
from dapple.formats.atomic import atomic
from dapple.workflow import run


def main(snakemake):
    params, folder = snakemake.params, Path(snakemake.output.page).parent
    with atomic(snakemake.output.page) as partial:
        partial.write_text(
            report.build(params.experiment, folder, params.captions), encoding="utf-8"
        )


if __name__ == "__main__":
    run(main, snakemake)
