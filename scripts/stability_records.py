"""Make records worse: wrong clocks, wrong places, fewer of them; how light agrees then."""

from pathlib import Path

import pandas as pd

from dapple import engine
from dapple.formats import netcdf, tables
from dapple.light.moved_sensors import moved_light
from dapple.scene import scene_files, sensors, traced
from dapple.scene.facing import facing_of
from dapple.stability import worse_records
from dapple.stats.pairs import simulated
from dapple.workflow import run

TOLERANCE, MAX_RAYS = 0.01, 1024
"""Of the share of the sun's disc that moved sensors see; most shadow rays for it."""


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    engine.use_threads(snakemake.threads)
    records = tables.read(inputs.records)
    unseen = records["part"] == "reporting"
    unseen &= records["reconstruction"].isin(params.reconstructions)
    records = records[unseen].reset_index(drop=True)
    labels = records["sensor"].unique()
    light = {Path(path).stem: netcdf.read(path).sel(sensor=labels) for path in inputs.light}
    sky, table = netcdf.read(inputs.sky), tables.read(inputs.sensors).set_index("sensor")
    table = table.loc[labels]
    sensors_m, facing = table[sensors.POSITION].to_numpy(), facing_of(table)
    scenes = {name: loaded(name, inputs, params) for name in params.reconstructions}

    def moved(error_m, seed):
        """The records with the light of wrong places."""
        if not error_m:
            return records
        options = {
            "sun_diameter_deg": params.sun_diameter_deg,
            "aperture_m": params.aperture_m,
            "response": params.response,
            "facing": facing,
            "max_rays": MAX_RAYS,
            "tolerance": TOLERANCE,
            "shift_m": error_m,
            "seed": seed,
        }
        there = [
            simulated(moved_light(scenes[name], sensors_m, light[name], sky, **options), name)
            for name in params.reconstructions
        ]
        print(f"sensors {error_m:g} m off", flush=True)
        keys = ["reconstruction", "sensor", "time"]
        return records.drop(columns="simulated").merge(pd.concat(there), on=keys)

    found = worse_records.table(
        records,
        pd.concat([simulated(one, name) for name, one in light.items()], ignore_index=True),
        moved,
        n_levels=params.levels,
        n_seeds=params.seeds,
        seed=params.seed,
    )
    tables.write(snakemake.output.records, found)


def loaded(name, inputs, params):
    """The scenes of a reconstruction as rays meet them."""
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    grid = [path for path in inputs.voxels if Path(path).parent.name == name]
    leaves = inputs.surfels if name == "surfels" else grid or inputs.leaves
    scenes = scene_files.read(leaves, inputs.wood, around)
    return [traced.load(scene, params.variant) for scene in scenes]


if __name__ == "__main__":
    run(main, snakemake)
