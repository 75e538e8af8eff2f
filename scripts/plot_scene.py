"""Fill the crowns of a plot with facets and lay the terrain under them."""

from dapple.cloud import ground
from dapple.figures import crown_map as figure
from dapple.figures import style
from dapple.formats import clouds, json, meshes, rasters, tables
from dapple.structure import crown_scene, facets
from dapple.workflow import options, run

SLICE_M = 2.0
"""Depth of the slice that the picture shows."""


def main(snakemake):
    inputs, output, settings = snakemake.input, snakemake.output, options(snakemake.params)
    noise, step_m = settings.pop("noise"), settings.pop("terrain_step_m")
    dem, labels = rasters.read(inputs.dem), rasters.read(inputs.crowns)
    cloud = ground.without_noise(clouds.read(inputs.lidar), inputs.lidar, **noise)
    scene = crown_scene.fill(cloud, labels, dem, where=inputs.lidar, **settings)
    terrain = facets.terrain(
        dem.values[0] - cloud.origin_m[2],
        left_m=dem.left_m - cloud.origin_m[0],
        top_m=dem.top_m - cloud.origin_m[1],
        pixel_m=dem.pixel_m,
        step_m=step_m,
    )
    meshes.write_ply(output.leaves, scene.leaves, cloud.origin_m)
    meshes.write_ply(output.wood, scene.wood, cloud.origin_m)
    meshes.write_ply(output.terrain, terrain, cloud.origin_m)
    tables.write(output.table, scene.table)
    summary = {"world_origin_m": cloud.origin_m, "crs": dem.crs} | scene.facts
    json.write(output.summary, summary)
    plants = meshes.concatenate([scene.leaves, scene.wood])
    centres_m = plants.vertices_m.reshape(-1, 4, 3).mean(axis=1)
    picture = figure.crowns(
        rasters.read(inputs.chm), labels, cloud.world_xyz_m, centres_m + cloud.origin_m, SLICE_M
    )
    style.save_both(picture, output.picture)
    print(summary)
    if scene.facts["pulses"]["returns"] == "single":
        print(
            "Single returns: what lies behind the first is not known, and plant area density comes "
            "out too high where canopies are closed. Export all returns of the pulses."
        )


if __name__ == "__main__":
    run(main, snakemake)
