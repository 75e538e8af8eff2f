"""How well simulated light matches measured light, on records that no fit has seen."""

import pandas as pd

from dapple.formats.atomic import atomic
from dapple.stats import correlation
from dapple.workflow import run


def main(snakemake):
    params, output = snakemake.params, snakemake.output
    records = pd.read_csv(
        snakemake.input.records, parse_dates=["time"], dtype={"sensor": str, "part": str}
    )
    unseen = records[records["part"] == "reporting"]
    tables = {
        output.overall: correlation.overall(
            unseen,
            seed=params.seed,
            n_bootstrap=params.n_bootstrap,
            confidence=params.confidence,
        ),
        output.per_sensor: correlation.per_sensor(unseen),
        output.mixed_model: correlation.mixed_model(unseen),
    }
    for path, table in tables.items():
        with atomic(path) as partial:
            table.to_csv(partial, index=False, float_format="%.6g")


if __name__ == "__main__":
    run(main, snakemake)
