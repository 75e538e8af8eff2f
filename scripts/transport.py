"""Trace paths from the sensors once, for any sky, spectrum and time."""

from dapple import steps
from dapple.formats import json, tables
from dapple.light import transport_files
from dapple.light.light_model import Model, Tracing
from dapple.scene import scene_files, scene_optics, sensors, traced
from dapple.scene.facing import facing_of
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    scene = scene_files.read([inputs.leaves], inputs.wood, around)[0]
    table = tables.read(inputs.sensors)
    sensors.check(table, scene.filled, where=params.sensor_table)
    sensors_m = table[["x_m", "y_m", "z_m"]].to_numpy()
    print(f"variant {params.variant}, {len(sensors_m)} sensors")
    counted = steps.paths(
        traced.load(scene, params.variant),
        sensors_m,
        Model(**(json.read(inputs.model) if inputs.model else params.model)),
        Tracing(**params.tracing),
        # Nominal spectra: the run's own may change without tracing again.
        optics=scene_optics.from_spectra(),
        facing=facing_of(table),
        seed=params.seed,
    )
    started = counted.n_paths * counted.n_replicates
    print(f"{started.min()} to {started.max()} paths a sensor, {counted.cut.sum()} given up")
    transport_files.write(snakemake.output.transport, counted)


if __name__ == "__main__":
    run(main, snakemake)
