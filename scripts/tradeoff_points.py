"""Error and cost of light over a grid of settings, all in this process."""

from dapple.advice import geometries, pilot, tradeoff
from dapple.advice.grid import Grid
from dapple.formats import netcdf, tables
from dapple.light.light_model import Tracing
from dapple.scene import scene_files, scene_optics
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    sky, table = netcdf.read(inputs.sky), tables.read(inputs.sensors)
    truth = None
    if inputs.truth:
        truth = scene_files.read([inputs.truth[0]], inputs.truth[1], around)[0]
    grid = Grid(
        table.iloc[pilot.spread(len(table), params.sensors)],
        sky.isel(time=pilot.daylight_times(sky, params.times)),
        scene_optics.read(inputs.optics),
        paths=params.paths,
        sky_patches=params.sky_patches,
        orders=params.orders,
        max_orders=params.max_orders,
        timestep_rays=params.timestep_rays,
        timestep=params.timestep,
        less_rays=params.less_rays,
        less=params.less,
        tracing=Tracing(**params.tracing),
        repeats=params.repeats,
        variant=params.variant,
        seed=params.seed,
        truth=truth,
    )
    base = scene_files.read([inputs.leaves], inputs.wood, around)[0]
    sizes = geometries.polygons(
        params.polygon_sizes_m, inputs.sized_leaves, inputs.sized_wood, around
    ) or [geometries.Geometry("polygons", params.polygon_size_m, lambda: base)]
    sizes += geometries.surfels(params.surfel_spacing_m, inputs.surfels, inputs.wood, around)
    sizes += geometries.voxels(params.voxel_sizes_m, inputs.voxels, base, around)
    points = grid.points(sizes, params.polygon_size_m)
    tables.write(snakemake.output.points, tradeoff.table(points))


if __name__ == "__main__":
    run(main, snakemake)
