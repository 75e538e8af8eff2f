"""Render the images that a UAV's camera takes of a virtual plot."""

import time

import numpy as np

from dapple.formats import json, meshes, rasters, tables
from dapple.formats.rasters import Raster
from dapple.optics import cameras
from dapple.optics.bands import camera_mean
from dapple.sky import spectrum
from dapple.streams import stream_seed
from dapple.virtual import camera, less_camera, plot_optics
from dapple.virtual.plot_materials import assemble
from dapple.workflow import options, peak_rss_mb, run


def main(snakemake):
    settings, inputs = options(snakemake.params), snakemake.input
    begun, seed = time.perf_counter(), settings["seed"]
    origin_m = np.asarray(settings["origin_m"], float)
    trees = tables.read(inputs.trees)
    trees[["x_m", "y_m", "z_m"]] -= origin_m
    seen_by = plot_optics.as_built(
        cameras.camera(settings["bands"], *inputs.responses),
        **settings["camera"],
        seed=stream_seed(seed, "camera"),
    )
    world, materials = assemble(
        trees,
        [meshes.read_ply(path) for path in inputs.leaves],
        [meshes.read_ply(path) for path in inputs.wood],
        meshes.read_ply(inputs.terrain),
        seen_by,
        crown=settings["crown"],
        ground=settings["ground"],
        seed=seed,
    )
    print(f"{len(world.faces)} triangles, {len(materials.reflectance)} materials")
    built = time.perf_counter()
    view = camera.View.over(settings["size_m"], settings["pixel_m"])
    sun = json.read(inputs.sun)
    sky = spectrum.cloudless_diffuse_share(
        sun["sun_zenith_deg"], aerosol_optical_depth_500nm=settings["aerosol_optical_depth"]
    )
    light = {
        "sun_zenith_deg": sun["sun_zenith_deg"],
        "sun_azimuth_deg": sun["sun_azimuth_deg"],
        "diffuse_share": camera_mean(*sky, seen_by),
        "seed": stream_seed(seed, "paths"),
    }
    paths = settings["paths_per_pixel"]
    if settings["renderer"] == "less":
        centres = np.array([band.centre_nm for band in seen_by.bands])
        # One set of paths serves all bands.
        light |= {"wavelength_nm": centres, "paths_per_pixel": max(paths)}
        image = less_camera.photograph(world, materials, view, **light)
    else:
        paths = [paths[seen_by.is_infrared(k)] for k in range(0, len(seen_by), 3)]
        scene = camera.build(world, materials)
        del world
        image = camera.photograph(scene, view, **light, paths_per_pixel=paths)
    image = camera.with_noise(image, **settings["noise"], seed=stream_seed(seed, "noise"))
    rasters.write(
        snakemake.output.images,
        Raster(
            image,
            origin_m[0] + view.left_m,
            origin_m[1] + view.top_m,
            view.pixel_m,
            settings["crs"],
            seen_by.names,
        ),
    )
    facts = {
        "rows": view.rows,
        "columns": view.columns,
        "diffuse_share": light["diffuse_share"],
        "mean_reflectance": image.mean(axis=(1, 2)).astype(float),
        "build_s": built - begun,
        "trace_s": time.perf_counter() - built,
        "peak_rss_mb": peak_rss_mb(),
    }
    json.write(snakemake.output.summary, facts)
    print(facts)


if __name__ == "__main__":
    run(main, snakemake)
