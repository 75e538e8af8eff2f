"""Fit the verdict to all stress runs, and tell how it does on runs that it was not fitted to."""

import pandas as pd

from dapple.formats import tables
from dapple.verdict import judgement
from dapple.workflow import run


def main(snakemake):
    points = tables.read(snakemake.input.points)
    found = judgement.store(snakemake.output.model, points)
    rows = []
    for kind, facts in found.items():
        for check, rates in facts["rates"].items():
            parts = rates if check.startswith("by_") else {"all": rates}
            rows += [{"signals": kind, "check": check, "of": of} | one for of, one in parts.items()]
    table = pd.DataFrame(rows)
    print(table[table["of"] == "all"].to_string())
    tables.write(snakemake.output.rates, table, "%.4g")


if __name__ == "__main__":
    run(main, snakemake)
