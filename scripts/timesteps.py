"""Light at the sensors by Mitsuba's own integrators, some times of the day."""

from dapple.formats import netcdf
from dapple.light import timestep_series
from dapple.progress import followed
from dapple.scene import scene_files, scene_optics
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    scenes, table = scene_files.with_sensors(inputs, params)
    reference = timestep_series.Reference(
        scenes,
        netcdf.read(inputs.sky).isel(time=params.times),
        scene_optics.read(inputs.optics),
        **params.engine,
        seed=params.seed,
    )
    positions = followed(list(params.positions), "times by Mitsuba")
    series = timestep_series.joined(reference.at(index, table) for index in positions)
    netcdf.write(snakemake.output.light, series)


if __name__ == "__main__":
    run(main, snakemake)
