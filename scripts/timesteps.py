"""Light at the sensors by Mitsuba's own integrators, one cached file a timestep."""

from dapple.formats import light, scenes
from dapple.light import sensors
from dapple.light.reference import Reference, run_all
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    reference = Reference(
        scenes.read(inputs.leaves, inputs.wood, params.ground_z_m),
        light.read(inputs.sky).isel(time=params.times),
        light.read_optics(inputs.optics),
        **params.engine,
        seed=params.seed,
    )
    computed = run_all(
        reference,
        sensors.read_local(inputs.sensors),
        snakemake.output.times,
        [*inputs.leaves, inputs.wood],
    )
    print(f"{computed} of {len(snakemake.output.times)} timesteps computed")


if __name__ == "__main__":
    run(main, snakemake)
