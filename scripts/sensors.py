"""Sensors in the local frame, none of them below the ground."""

from dapple.formats import json, meshes, tables
from dapple.scene import sensors
from dapple.structure.stem import stem_position
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    if params.kind == "table":
        fitted = json.read(inputs.registration) if inputs.registration else {}
        origin_m = fitted.get("origin_m", params.origin_m)
        table = sensors.read(inputs.table, origin_m, **params.table)
    else:
        table = sensors.grid_around(
            stem_position(meshes.read_ply(inputs.wood)),
            **params.grid,
            ground_z_m=params.ground_z_m,
        )
    where = str(inputs.table or "sensors")
    sensors.check(table, {}, ground_z_m=params.ground_z_m, where=where)
    tables.write(snakemake.output.sensors, table, None)


if __name__ == "__main__":
    run(main, snakemake)
