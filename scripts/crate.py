"""Metadata of a run as an RO-Crate."""

from pathlib import Path

from dapple import provenance
from dapple.formats import json
from dapple.workflow import run

PACKAGES = ("snakemake", "numpy", "pandas", "mitsuba", "pvlib", "prosail")


def main(snakemake):
    crate = provenance.describe(
        Path(snakemake.output.crate).parent,
        experiment=snakemake.params.experiment,
        data=list(snakemake.input.data),
        packages=PACKAGES,
    )
    json.write(snakemake.output.crate, crate)


if __name__ == "__main__":
    run(main, snakemake)
