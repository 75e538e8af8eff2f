"""Map leaf chlorophyll from observed cells, with intervals, by the networks of one model."""

from dataclasses import asdict, replace

import numpy as np

from dapple.formats import json, rasters, tables
from dapple.retrieval import intervals, maps, network, training_entries
from dapple.retrieval.noise import Noise
from dapple.workflow import run


def main(snakemake):
    params, inputs, output = snakemake.params, snakemake.input, snakemake.output
    groups = np.reshape(inputs.networks, (-1, len(params.seeds)))
    files = zip(
        params.taught, inputs.training, groups, inputs.observed, output.maps, output.intervals,
        strict=True,
    )  # fmt: skip
    for taught, table_path, network_paths, observed_path, map_path, interval_path in files:
        networks = [network.read(path) for path in network_paths]
        noise = Noise(**params.errors) if taught["network"] == "robust" else None
        interval, known = calibrate(tables.read(table_path), networks, noise, params)
        observed = rasters.read(observed_path)
        bands = rasters.select(observed, params.bands, observed_path).values
        layers, each = maps.retrieve(networks, interval, known, bands)
        names = (*maps.MAP_BANDS, *(f"seed_{seed}_ug_cm2" for seed in params.seeds))
        rasters.write(
            map_path, replace(observed, values=np.concatenate([layers, each]), bands=names)
        )
        there = np.isfinite(layers[0])
        facts = {
            "interval": asdict(interval),
            "range_limit": known.limit,
            "cells": int(there.sum()),
            "outside_share": float(layers[4][there].mean()) if there.any() else None,
        }
        json.write(interval_path, facts)
        print(taught, f"beyond the training range: {facts['outside_share']}")


def calibrate(frame, networks, noise, params):
    """Interval and training range of networks, from bands as the networks were taught by."""
    parts = network.split(
        frame["combination"].to_numpy(), seed=params.split_seed, **dict(params.split)
    )
    features = training_entries.features(frame, params.bands)
    target = training_entries.chlorophyll(frame)
    if noise:
        features = noise.add(features, np.random.default_rng(params.split_seed))
    held = parts["validation"]
    interval = intervals.fit(
        *maps.ensemble(networks, features[held]), target[held], level=params.level
    )
    known = intervals.training_range(
        features[parts["train"]], seed=params.split_seed, quantile=params.range_quantile
    )
    return interval, known


if __name__ == "__main__":
    run(main, snakemake)
