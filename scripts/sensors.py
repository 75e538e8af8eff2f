"""Sensors in the local frame, none of them below the ground."""

from dapple.formats import json, meshes, tables
from dapple.scene import scene_files, sensors
from dapple.structure.stem import stem_position
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    ground = scene_files.around(inputs.ground or params.ground_z_m).ground
    if params.kind == "table":
        known = json.read(inputs.frame)["origin_m"] if inputs.frame else params.origin_m
        table = sensors.read(inputs.table, known or (0.0, 0.0, 0.0), **params.table)
        if params.table["heights"] == "above_ground":
            table = sensors.on_ground(table, ground)
        elif inputs.ground:
            table = sensors.lifted(table, ground)
    else:
        stem_m = stem_position(meshes.read_ply(inputs.wood))
        table = sensors.grid_around(stem_m, **params.grid, ground=ground)
        table = sensors.turned(table, **params.facing)
    sensors.check(table, ground=ground, where=str(inputs.table or "sensors"))
    low_m, high_m = table["z_m"].min(), table["z_m"].max()
    print(f"{len(table)} sensors, {low_m:.2f} to {high_m:.2f} m high in the local frame")
    tables.write(snakemake.output.sensors, table, None)


if __name__ == "__main__":
    run(main, snakemake)
