"""Time and memory of every step, from Snakemake's benchmark files."""

from pathlib import Path

from dapple.formats import tables
from dapple.stats import runtime
from dapple.workflow import run


def main(snakemake):
    folder = Path(snakemake.output.runtime).parent / "benchmarks"
    table = runtime.collect(sorted(folder.rglob("*.tsv")), folder, snakemake.params.reconstructions)
    tables.write(snakemake.output.runtime, table, "%.2f")


if __name__ == "__main__":
    run(main, snakemake)
