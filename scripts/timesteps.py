"""Light at the sensors by Mitsuba's own integrators, some times of the day."""

from dapple.formats import netcdf, tables
from dapple.light import timestep_series
from dapple.scene import scene_files, scene_optics, sensors
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    scenes = scene_files.read(inputs.leaves, inputs.wood, around)
    table = tables.read(inputs.sensors)
    for scene in scenes:
        sensors.check(table, scene.filled, where=params.sensor_table)
    reference = timestep_series.Reference(
        scenes,
        netcdf.read(inputs.sky).isel(time=params.times),
        scene_optics.read(inputs.optics),
        **params.engine,
        seed=params.seed,
    )
    series = timestep_series.joined(reference.at(index, table) for index in params.positions)
    netcdf.write(snakemake.output.light, series)


if __name__ == "__main__":
    run(main, snakemake)
