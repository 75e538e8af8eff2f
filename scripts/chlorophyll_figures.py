"""Figures of one plot: scatter plots, spectra, losses, map."""

import numpy as np
import pandas as pd

from dapple.figures import chlorophyll_maps, style
from dapple.formats import rasters, tables, vectors
from dapple.optics.cameras import camera
from dapple.workflow import run

QUANTILES = {"low": 0.05, "middle": 0.5, "high": 0.95}


def main(snakemake):
    inputs, output, params = snakemake.input, snakemake.output, snakemake.params
    accuracy = pd.concat([tables.read(path) for path in inputs.accuracy])
    accuracy = accuracy[accuracy["seed"].astype(str) == "ensemble"]
    tests = pd.concat([tables.read(path) for path in inputs.tests])
    own = accuracy[accuracy["test_set"] == "entries"]
    style.save_both(chlorophyll_maps.simulated(tests, own), output.simulated)
    trees = pd.concat([tables.read(path) for path in inputs.trees])
    own = accuracy[accuracy["test_set"] == "field"]
    style.save_both(chlorophyll_maps.field(trees, own), output.field)
    entries = {
        path: quantiles(tables.read(path), camera(params.bands), taught)
        for path, taught in zip(inputs.training, params.taught, strict=True)
    }
    figure = chlorophyll_maps.spectra(tables.read(inputs.pixels), pd.concat(entries.values()))
    style.save_both(figure, output.spectra)
    histories = [
        tables.read(path).assign(**taught)
        for path, taught in zip(inputs.histories, params.taught, strict=True)
    ]
    style.save_both(chlorophyll_maps.losses(pd.concat(histories)), output.losses)
    images, found = rasters.read(inputs.canopy), rasters.read(inputs.map)
    rings, truth = [], []
    if inputs.crowns:
        corner = np.array([found.left_m, images.bottom_m])
        rings, truth = outlines(vectors.read(inputs.crowns), corner)
    figure = chlorophyll_maps.chlorophyll_map(
        found.values[:5],
        cell_m=found.pixel_m,
        size_m=(images.right_m - images.left_m, images.top_m - images.bottom_m),
        rings=rings,
        truth=truth,
    )
    style.save_both(figure, output.map)


def outlines(crowns, corner):
    """Outer rings from the south-west corner east and north [m], and the chlorophyll of each."""
    rings, truth = [], []
    for geometry, true in zip(crowns.geometries, crowns.lcc_ug_cm2, strict=True):
        parts = geometry["coordinates"]
        for part in [parts] if geometry["type"] == "Polygon" else parts:
            rings.append(np.asarray(part[0], float)[:, :2] - corner)
            truth.append(true)
    return rings, truth


def quantiles(frame, seen_by, taught):
    """Quantiles of the bands of a training set."""
    bands = frame[list(seen_by.names)]
    table = bands.quantile(list(QUANTILES.values())).T.set_axis(list(QUANTILES), axis=1)
    table["wavelength_nm"] = [round(band.centre_nm) for band in seen_by]
    return table.assign(model=taught["model"], mask=taught["mask"])


if __name__ == "__main__":
    run(main, snakemake)
