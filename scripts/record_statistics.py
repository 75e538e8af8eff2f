"""How well simulated light matches measured light, on records that no fit has seen."""

from dapple.formats import tables
from dapple.stats import correlation, measures
from dapple.workflow import run


def main(snakemake):
    params, output = snakemake.params, snakemake.output
    records = tables.read(snakemake.input.records)
    unseen = records[records["part"] == "reporting"]
    found = {
        output.overall: correlation.overall(
            unseen,
            seed=params.seed,
            n_bootstrap=params.n_bootstrap,
            confidence=params.confidence,
        ),
        output.per_sensor: measures.per_sensor(unseen),
        output.mixed_model: correlation.mixed_model(unseen),
    }
    for path, table in found.items():
        tables.write(path, table)


if __name__ == "__main__":
    run(main, snakemake)
