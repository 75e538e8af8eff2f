"""Train networks on one training set, one per seed."""

import time

import pandas as pd

from dapple.formats import tables
from dapple.progress import followed
from dapple.retrieval import network, training_entries
from dapple.retrieval.noise import Noise
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    frame = tables.read(snakemake.input.training)
    parts = network.split(
        frame["combination"].to_numpy(), seed=params.split_seed, **dict(params.split)
    )
    features = training_entries.features(frame, params.bands)
    target = training_entries.chlorophyll(frame)
    margin = 0.1 * (params.range_ug_cm2[1] - params.range_ug_cm2[0])
    histories = []
    wanted = list(zip(params.seeds, snakemake.output.networks, strict=True))
    for seed, path in followed(wanted, "networks"):
        start = time.perf_counter()
        net, history = network.train(
            features[parts["train"]],
            target[parts["train"]],
            features[parts["validation"]],
            target[parts["validation"]],
            seed=seed,
            low=params.range_ug_cm2[0] - margin,
            high=params.range_ug_cm2[1] + margin,
            noise=Noise(**params.errors) if params.errors else None,
            **dict(params.options),
        )
        best = history.loc[history["validation_loss"].idxmin()]
        print(
            f"seed {seed}: {len(parts['train'])} entries, {len(history)} epochs in "
            f"{time.perf_counter() - start:.1f} s, best at epoch {best['epoch']:.0f}, "
            f"validation loss {best['validation_loss']:.5f}"
        )
        network.write(path, net)
        histories.append(history.assign(seed=seed))
    tables.write(snakemake.output.history, pd.concat(histories))


if __name__ == "__main__":
    run(main, snakemake)
