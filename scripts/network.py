"""Train one network on one training set."""

import time

import pandas as pd

from dapple.formats.atomic import atomic
from dapple.retrieval import network, training
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    frame = pd.read_parquet(snakemake.input.training)
    parts = network.split(
        frame["combination"].to_numpy(), seed=params.split_seed, **dict(params.split)
    )
    features, target = training.features(frame), frame["chlorophyll_ug_cm2"].to_numpy()
    margin = 0.1 * (params.range_ug_cm2[1] - params.range_ug_cm2[0])
    start = time.perf_counter()
    net, history = network.train(
        features[parts["train"]],
        target[parts["train"]],
        features[parts["validation"]],
        target[parts["validation"]],
        seed=int(params.seed),
        low=params.range_ug_cm2[0] - margin,
        high=params.range_ug_cm2[1] + margin,
        **dict(params.network),
    )
    best = history.loc[history["validation_loss"].idxmin()]
    print(
        f"{len(parts['train'])} entries, {len(history)} epochs in "
        f"{time.perf_counter() - start:.1f} s, best at epoch {best['epoch']:.0f}, "
        f"validation loss {best['validation_loss']:.5f}"
    )
    network.write(snakemake.output.network, net)
    with atomic(snakemake.output.history) as partial:
        history.to_csv(partial, index=False, float_format="%.6g")


if __name__ == "__main__":
    run(main, snakemake)
