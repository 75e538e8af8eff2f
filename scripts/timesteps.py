"""Light at the sensors by Mitsuba's own integrators, one cached file a timestep."""

from dapple.formats import netcdf, tables
from dapple.light.timestep_series import Reference, run_all
from dapple.scene import scene_files, scene_optics
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    reference = Reference(
        scene_files.read(inputs.leaves, inputs.wood, params.ground_z_m),
        netcdf.read(inputs.sky).isel(time=params.times),
        scene_optics.read(inputs.optics),
        **params.engine,
        seed=params.seed,
    )
    computed = run_all(
        reference,
        tables.read(inputs.sensors),
        snakemake.output.times,
        [*inputs.leaves, inputs.wood],
    )
    print(f"{computed} of {len(snakemake.output.times)} timesteps computed")


if __name__ == "__main__":
    run(main, snakemake)
