"""Light at the sensors by LESS 3, some times of the day."""

from dapple.formats import netcdf
from dapple.light import less_engine
from dapple.light.less_files import LessRays
from dapple.scene import scene_files, scene_optics
from dapple.workflow import evenly, run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    scenes, table = scene_files.with_sensors(inputs, params)
    if params.most_sensors:
        table = table.iloc[evenly(len(table), params.most_sensors)]
    light = less_engine.series(
        scenes,
        netcdf.read(inputs.sky).isel(time=params.times),
        scene_optics.read(inputs.optics),
        table,
        rays=LessRays(**params.rays, seed=params.seed),
        **params.engine,
    )
    netcdf.write(snakemake.output.light, light)


if __name__ == "__main__":
    run(main, snakemake)
