"""Make records worse: wrong clocks, wrong places, fewer of them; how light agrees then."""

from pathlib import Path

import pandas as pd

from dapple import engine
from dapple.formats import netcdf, tables
from dapple.light.moved_sensors import moved_light
from dapple.scene import scene_files, traced
from dapple.stability import worse_records
from dapple.stats.pairs import simulated
from dapple.workflow import run

TOLERANCE, MAX_RAYS = 0.01, 1024
"""Of the share of the sun's disc that moved sensors see; most shadow rays for it."""


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    engine.use_threads(snakemake.threads)
    told = tables.read(inputs.records)
    told = told[(told["part"] == "reporting") & told["reconstruction"].isin(params.methods)]
    lit = Lit(inputs, params, told["sensor"].unique())

    def moved(error_m, seed):
        if not error_m:
            return told
        there = pd.concat([lit.moved(name, error_m, seed) for name in params.methods])
        print(f"sensors {error_m:g} m off", flush=True)
        return told.drop(columns="simulated").merge(there, on=["reconstruction", "sensor", "time"])

    found = worse_records.table(
        told.reset_index(drop=True),
        pd.concat([simulated(one, name) for name, one in lit.light.items()], ignore_index=True),
        moved,
        n_levels=params.levels,
        n_seeds=params.seeds,
        seed=params.seed,
    )
    tables.write(snakemake.output.records, found)


class Lit:
    """The light of a run, its scenes and what shines on them."""

    def __init__(self, inputs, params, reporting):
        self.params, self.sky = params, netcdf.read(inputs.sky)
        self.light = {
            Path(path).stem: netcdf.read(path).sel(sensor=reporting) for path in inputs.light
        }
        table = tables.read(inputs.sensors).set_index("sensor")
        self.places_m = table.loc[reporting, ["x_m", "y_m", "z_m"]].to_numpy()
        self.scenes = {}
        for name in params.methods:
            grid = [path for path in inputs.voxels if Path(path).parent.name == name]
            found = scene_files.read(grid or inputs.leaves, inputs.wood, params.ground_z_m)
            self.scenes[name] = [traced.load(scene, params.variant) for scene in found]

    def moved(self, name, error_m, seed):
        """Light of one reconstruction at wrong places, as a table."""
        there = moved_light(
            self.scenes[name],
            self.places_m,
            self.light[name],
            self.sky,
            shift_m=error_m,
            seed=seed,
            max_rays=MAX_RAYS,
            tolerance=TOLERANCE,
            sun_diameter_deg=self.params.sun_diameter_deg,
            aperture_m=self.params.aperture_m,
        )
        return simulated(there, name)


if __name__ == "__main__":
    run(main, snakemake)
