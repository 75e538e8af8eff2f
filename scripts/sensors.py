"""Sensors in the local frame, none of them outside the scene or inside a leaf."""

from dapple.formats import json, meshes, tables
from dapple.scene import sensors
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    wood = meshes.read_ply(inputs.wood)
    if params.kind == "table":
        origin_m = json.read(inputs.registration)["origin_m"]
        table = sensors.read(inputs.table, origin_m, **params.table)
    else:
        table = sensors.grid_around(
            sensors.stem_position(wood),
            **params.grid,
            ground_z_m=params.ground_z_m,
        )
    for path in inputs.leaves:
        geometry = {"leaf": meshes.read_ply(path), "wood": wood}
        where = str(inputs.table or "sensors")
        sensors.check(table, geometry, ground_z_m=params.ground_z_m, where=where)
    tables.write(snakemake.output.sensors, table, None)


if __name__ == "__main__":
    run(main, snakemake)
