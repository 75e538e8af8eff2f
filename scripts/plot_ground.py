"""Find the ground under a plot: elevation model, canopy height model, and ground points."""

import numpy as np

from dapple.cloud import ground
from dapple.formats import cloud_crs, clouds, json, rasters
from dapple.formats.clouds import Cloud
from dapple.workflow import options, run


def main(snakemake):
    path, output = snakemake.input.lidar, snakemake.output
    settings = options(snakemake.params)
    crs = cloud_crs.horizontal(path, settings["crs"])
    cloud = clouds.read(path)
    n_points = len(cloud)
    cloud = ground.without_noise(cloud, path, **settings["noise"])
    world = cloud.world_xyz_m
    dem, chosen = ground.model(world, crs=crs, where=path, **settings["ground"])
    height = ground.heights(world, dem)
    spacing_m = ground.spacing_m(world)
    chm = ground.canopy_height(
        world[:, :2],
        height,
        dem,
        pixel_m=max(settings["chm_pixel_m"], round(spacing_m, 2)),
        reach_m=settings["reach_m"],
    )
    rasters.write(output.dem, dem)
    rasters.write(output.chm, chm)
    points = Cloud(
        cloud.xyz_m[chosen],
        cloud.origin_m,
        {"Classification": np.full(len(chosen), 2, np.uint8)},
    )
    clouds.write(output.ground, points, scale_m=0.001)
    facts = {
        "n_points": n_points,
        "noise_points": n_points - len(cloud),
        "ground_points": len(chosen),
        "points_per_m2": spacing_m**-2,
        "crs": crs,
        "world_origin_m": cloud.origin_m,
        "chm_pixel_m": chm.pixel_m,
        "largest_height_m": float(np.nanmax(chm.values)),
    }
    json.write(output.facts, facts)
    print(facts)


if __name__ == "__main__":
    run(main, snakemake)
