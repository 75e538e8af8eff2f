"""Average canopy pixels of the observed images over the cells of the map."""

import numpy as np
import pandas as pd

from dapple.formats import rasters, tables
from dapple.optics.cameras import camera
from dapple.retrieval import maps, training_entries
from dapple.workflow import run


def main(snakemake):
    params, path = snakemake.params, snakemake.input.images
    seen_by = camera(params.bands)
    observed = rasters.select(rasters.read(path), seen_by.names, path)
    heights = rasters.read(snakemake.input.heights)
    rasters.require_overlap(
        heights,
        (observed.left_m, observed.bottom_m),
        (observed.right_m, observed.top_m),
        observed.crs,
        where=snakemake.input.heights,
        other=path,
    )
    grid = {
        "left_m": observed.left_m,
        "top_m": observed.top_m,
        "pixel_m": params.pixel_m,
        "shape": maps.shape_of(observed, params.pixel_m),
    }
    image = maps.resample(observed, **grid)
    height_m = maps.sample(heights, **grid)[0]
    canopy = maps.canopy(
        height_m, min_height_m=params.canopy_height_m, where=snakemake.input.heights
    )
    over = training_entries.cells(canopy.shape, pixel_m=params.pixel_m, cell_m=params.cell_m)
    found = training_entries.aggregate(
        training_entries.chunks_of(image), canopy, over,
        near_infrared=seen_by.near_infrared, sunlit_nir=params.sunlit_nir,
        min_share=params.min_share,
    )  # fmt: skip
    corner = (observed.left_m, observed.top_m)
    for mask, (means, count) in found.items():
        layers = np.concatenate([means[0], count.astype(np.float32)])
        bands = (*seen_by.names, "pixels")
        raster = rasters.Raster(layers, *corner, params.cell_m, observed.crs, bands)
        rasters.write(snakemake.output[mask], raster)
        print(f"{mask}: {np.isfinite(means[0, 0]).sum()} of {means[0, 0].size} cells with data")
    mask = rasters.Raster(
        canopy[None].astype(np.float32), *corner, params.pixel_m, observed.crs, ("canopy",)
    )
    rasters.write(snakemake.output.canopy, mask)
    tables.write(snakemake.output.pixels, pixel_spectra(image, canopy, seen_by, params.sunlit_nir))


def pixel_spectra(image, canopy, seen_by, sunlit_nir):
    """Mean and deviation of each band over sunlit, shaded and all canopy pixels."""
    how = {"near_infrared": seen_by.near_infrared, "sunlit_nir": sunlit_nir}
    known = training_entries.select(image, canopy, mask="all", **how)
    sunlit = training_entries.select(image, canopy, mask="sunlit", **how)
    kinds = {"sunlit": sunlit, "shaded": known & ~sunlit, "all": known}
    rows = [
        {
            "kind": kind,
            "wavelength_nm": round(band.centre_nm),
            "n": int(chosen.sum()),
            "mean": float(values[chosen].mean()) if chosen.any() else np.nan,
            "deviation": float(values[chosen].std()) if chosen.any() else np.nan,
        }
        for kind, chosen in kinds.items()
        for band, values in zip(seen_by, image, strict=True)
    ]
    return pd.DataFrame(rows)


if __name__ == "__main__":
    run(main, snakemake)
