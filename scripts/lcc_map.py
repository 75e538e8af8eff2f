"""Map leaf chlorophyll from observed cells, with intervals."""

from dataclasses import asdict, replace

import numpy as np
import pandas as pd

from dapple.formats import json, rasters
from dapple.retrieval import intervals, maps, network, training
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    frame = pd.read_parquet(snakemake.input.training)
    parts = network.split(
        frame["combination"].to_numpy(), seed=params.split_seed, **dict(params.split)
    )
    networks = [network.read(path) for path in snakemake.input.networks]
    features, target = training.features(frame), frame["chlorophyll_ug_cm2"].to_numpy(float)
    held = parts["validation"]
    interval = intervals.fit(
        *maps.ensemble(networks, features[held]), target[held], level=params.level
    )
    taught = intervals.training_range(
        features[parts["train"]], seed=params.split_seed, quantile=params.range_quantile
    )
    observed = rasters.read(snakemake.input.observed)
    bands = rasters.select(observed, training.BANDS, snakemake.input.observed).values
    layers, each = maps.retrieve(networks, interval, taught, bands)
    names = (*maps.MAP_BANDS, *(f"seed_{seed}_ug_cm2" for seed in params.seeds))
    raster = replace(observed, values=np.concatenate([layers, each]), bands=names)
    rasters.write(snakemake.output.map, raster)
    known = np.isfinite(layers[0])
    json.write(
        snakemake.output.interval,
        {
            "interval": asdict(interval),
            "range_limit": taught.limit,
            "cells": int(known.sum()),
            "outside_share": float(layers[4][known].mean()) if known.any() else None,
        },
    )


if __name__ == "__main__":
    run(main, snakemake)
