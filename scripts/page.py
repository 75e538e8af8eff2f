"""One self-contained page that tells the run."""

from pathlib import Path

from dapple.formats.atomic import atomic
from dapple.report import run_report
from dapple.workflow import run


def main(snakemake):
    params, folder = snakemake.params, Path(snakemake.output.page).parent
    page = run_report.build(params.experiment, folder, params.captions)
    with atomic(snakemake.output.page) as partial:
        partial.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    run(main, snakemake)
