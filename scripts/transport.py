"""Trace paths from the sensors once, for any sky, spectrum and time."""

from dapple import steps
from dapple.formats import json, tables
from dapple.light import by_sensor, tiles, transport_files
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
    model = Model(**(json.read(inputs.model) if inputs.model else params.model))
    tracing, tiling = Tracing(**params.tracing), tiles.Tiling(**params.tiles)

    def trace(part, some):
        return steps.paths(
            traced.load(part, params.variant),
            some[sensors.POSITION].to_numpy(),
            model,
            tracing,
            # Nominal spectra: the run's own may change without tracing again.
            optics=scene_optics.from_spectra(),
            facing=facing_of(some),
            keys=by_sensor.keys(some),
            seed=params.seed,
        )

    print(f"variant {params.variant}, {len(table)} sensors")
    files = [inputs.leaves, inputs.wood, *inputs.code]
    files += [path for path in (inputs.ground, inputs.shade) if path]
    identities = by_sensor.identities(
        table, files, model.sky_patches, model.max_orders, tracing,
        params.ground_z_m, params.variant, params.seed, tiling,
    )  # fmt: skip
    known = by_sensor.former(snakemake.output.transport, transport_files.read)
    counted = by_sensor.completed(
        identities, known, table,
        lambda some: tiles.by_tile(scene, some, tiling, params.seed, trace),
    )  # fmt: skip
    started = counted.n_paths * counted.n_replicates
    print(f"{started.min()} to {started.max()} paths a sensor, {counted.cut.sum()} given up")
    transport_files.write(snakemake.output.transport, counted, identities)


if __name__ == "__main__":
    run(main, snakemake)
