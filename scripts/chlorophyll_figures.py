"""Figures of one plot: scatter plots, spectra, losses, map."""

from pathlib import Path

import numpy as np
import pandas as pd

from dapple.figures import chlorophyll, style
from dapple.formats import polygons, rasters
from dapple.retrieval import training
from dapple.workflow import run

QUANTILES = {"low": 0.05, "middle": 0.5, "high": 0.95}


def main(snakemake):
    inputs, output, params = snakemake.input, snakemake.output, snakemake.params
    accuracy = pd.concat([pd.read_csv(path) for path in inputs.accuracy])
    accuracy = accuracy[accuracy["seed"].astype(str) == "ensemble"]
    tests = pd.concat([pd.read_parquet(path) for path in inputs.tests])
    own = accuracy[accuracy["test_set"] == "entries"]
    style.save(chlorophyll.simulated(tests, own), output.simulated)
    trees = pd.concat([pd.read_csv(path) for path in inputs.trees])
    own = accuracy[accuracy["test_set"] == "field"]
    style.save(chlorophyll.field(trees, own), output.field)
    entries = pd.concat(
        [quantiles(pd.read_parquet(path, columns=list(training.BANDS)), *pair)
         for path, pair in zip(inputs.training, params.taught, strict=True)]
    )  # fmt: skip
    style.save(chlorophyll.spectra(pd.read_csv(inputs.pixels), entries), output.spectra)
    style.save(chlorophyll.losses(histories(inputs.histories)), output.losses)
    images, found = rasters.read(inputs.canopy), rasters.read(inputs.map)
    crowns = polygons.read(inputs.crowns)
    corner = np.array([found.left_m, found.top_m])
    rings = [(np.asarray(ring) - corner) * (1, -1) for ring in crowns.outlines()]
    figure = chlorophyll.chlorophyll_map(
        found.values[:5],
        cell_m=found.pixel_m,
        size_m=(images.right_m - images.left_m, images.top_m - images.bottom_m),
        rings=rings,
        truth=crowns.lcc_ug_cm2,
    )
    style.save(figure, output.map)


def quantiles(frame, model, mask):
    """Quantiles of the bands of a training set."""
    table = frame.quantile(list(QUANTILES.values())).T.set_axis(list(QUANTILES), axis=1)
    table["wavelength_nm"] = table.index.astype(int)
    return table.assign(model=model, mask=mask)


def histories(paths):
    """Loss curves of all networks, told apart by the names of their files."""
    tables = []
    for path in paths:
        _, *model, mask, seed = Path(path).stem.split("_")
        tables.append(pd.read_csv(path).assign(model="_".join(model), mask=mask, seed=int(seed)))
    return pd.concat(tables)


if __name__ == "__main__":
    run(main, snakemake)
