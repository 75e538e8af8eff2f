"""Simulate images of many leaves and soils and average their canopy pixels over cells."""

import time
from dataclasses import replace

import numpy as np

from dapple.errors import InputError
from dapple.formats import json, meshes, rasters, tables
from dapple.optics.cameras import camera
from dapple.retrieval import coefficient_files as files
from dapple.retrieval import coefficients, prosail, semiless, spectra, training_entries
from dapple.retrieval.flight_light import shares
from dapple.workflow import options, run


def main(snakemake):
    params, start = options(snakemake.params), time.perf_counter()
    canopy = rasters.read(snakemake.input.canopy)
    settings = params["leaves_and_soils"]
    seen_by = camera(params["bands"], *snakemake.input.responses)
    leaves, properties = spectra.combinations(
        settings, settings["combinations"], seen_by, seed=params["seed"]
    )
    share = shares(json.read(snakemake.input.sky), leaves["aerosol_optical_depth"].to_numpy())
    origin_m = json.read(snakemake.input.summary)["world_origin_m"]
    if params["model"] == "prosail":
        chunks, mask, pixel_m = level_canopies(
            snakemake.input, canopy, properties, share, origin_m, params
        )
    else:
        (path,) = snakemake.input.simulation
        chunks, window = images(path, properties, params["model"], params["bark"], share)
        check_window(window, canopy, origin_m, path)
        mask, pixel_m = canopy.values[0] > 0, canopy.pixel_m
    selection = params["selection"]
    over = training_entries.cells(mask.shape, pixel_m=pixel_m, cell_m=selection["cell_m"])
    found = training_entries.aggregate(
        chunks, mask, over, near_infrared=seen_by.near_infrared,
        sunlit_nir=selection["sunlit_nir"], min_share=selection["min_share"],
    )  # fmt: skip
    for name, (means, count) in found.items():
        path = snakemake.output[name]
        frame = training_entries.entries(
            means, count, leaves, seen_by.names,
            max_entries=params["max_entries"], seed=params["seed"], where=path,
        )  # fmt: skip
        n_made = int(np.isfinite(means[:, 0]).sum())
        print(f"{name}: {n_made} entries of {len(leaves)} combinations, {len(frame)} kept")
        tables.write(path, frame)
    print(f"{time.perf_counter() - start:.1f} s")


def images(path, properties, model, bark, share):
    """Chunks of pixels of images by three-dimensional transport, and their grid."""
    leaf = (properties.leaf_reflectance, properties.leaf_transmittance)
    if model == "semi_less":
        fitted = replace(files.read_semiless(path), diffuse_share=share)
        return semiless.image_chunks(fitted, *leaf, properties.soil_reflectance), fitted.window
    traced = files.read(path)
    all_of_it = coefficients.Combinations(*leaf, bark, properties.soil_reflectance, share)
    return coefficients.image_chunks(traced, all_of_it), traced.window


def level_canopies(inputs, canopy, properties, share, origin_m, params):
    """SAIL of every cell with plants and canopy pixels, as pixels as large as cells."""
    cell_m = params["selection"]["cell_m"]
    over = training_entries.cells(canopy.values.shape[1:], pixel_m=canopy.pixel_m, cell_m=cell_m)
    plants = meshes.concatenate([meshes.read_ply(path) for path in inputs.simulation])
    index = prosail.plant_area_index(
        plants, left_m=canopy.left_m - origin_m[0], top_m=canopy.top_m - origin_m[1],
        cell_m=cell_m, shape=over.shape,
    )  # fmt: skip
    number = np.bincount(over.of_pixel, canopy.values[0].ravel() > 0, index.size)
    enough = number >= params["selection"]["min_share"] * over.pixels_per_cell
    mask = enough.reshape(index.shape) & (index > 0)
    print(f"plant area index of {mask.sum()} cells: mean {index[mask].mean():.2f}")
    values = prosail.images(
        index, properties, sun_zenith_deg=json.read(inputs.sun)["sun_zenith_deg"],
        diffuse_share=share, **params["sail"],
    )  # fmt: skip
    return [(slice(0, len(values)), values)], mask, cell_m


def check_window(window, canopy, origin_m, path):
    """Simulated and observed images lie on one grid."""
    found = (window.left_m + origin_m[0], window.top_m + origin_m[1], window.pixel_m)
    wanted = (canopy.left_m, canopy.top_m, canopy.pixel_m)
    shape = (window.rows, window.columns)
    if not np.allclose(found, wanted, rtol=0, atol=1e-3) or shape != canopy.values.shape[1:]:
        raise InputError(
            path, f"images from {found} of {shape} pixels",
            f"{wanted} of {canopy.values.shape[1:]}", "Make the simulated images again.",
        )  # fmt: skip


if __name__ == "__main__":
    run(main, snakemake)
