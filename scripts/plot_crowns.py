"""Divide the canopy of a plot into crowns and sub-crowns."""

from dataclasses import replace

import numpy as np

from dapple.cloud import crowns
from dapple.formats import json, rasters
from dapple.workflow import options, run


def main(snakemake):
    settings = options(snakemake.params)
    chm = rasters.read(snakemake.input.chm)
    labels = crowns.crowns(chm.values[0], pixel_m=chm.pixel_m, **settings["crowns"])
    points_per_m2 = json.read(snakemake.input.facts)["points_per_m2"]
    area_m2 = max(settings["area_m2"], settings["least_points"] / points_per_m2)
    sub, crown = crowns.sub_crowns(
        labels, pixel_m=chm.pixel_m, area_m2=area_m2, seed=settings["seed"]
    )
    print(f"{labels.max()} crowns, {len(crown)} sub-crowns, cover {(labels > 0).mean():.3f}")
    values = np.where(labels > 0, [labels, sub], np.nan).astype(np.float32)
    rasters.write(
        snakemake.output.crowns, replace(chm, values=values, bands=("crown", "sub_crown"))
    )


if __name__ == "__main__":
    run(main, snakemake)
