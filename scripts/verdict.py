"""How far a run can be trusted: its signals, and what they mean."""

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats import clouds, json, meshes, netcdf, shots, tables, voxel_grids
from dapple.formats.clouds import LEAF
from dapple.light.moved_sensors import moved_light
from dapple.scene import scene_files, traced
from dapple.structure.subvoxel_clumping import as_estimated
from dapple.verdict import judgement, signals
from dapple.verdict.inputs import Evidence, count_points, no_mesh
from dapple.workflow import run

TIMES = 24
"""Times of the day at which light is looked at."""
SHIFT_M = 0.1


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    evidence = gather(inputs, params)
    judged = judgement.judge(signals.measure(evidence), tuple(params.methods))
    json.write(snakemake.output.verdict, judged)
    print(judged["state"], {name: facts["state"] for name, facts in judged["methods"].items()})


def gather(inputs, params):
    """The evidence of a run from its files; what it did not make stays empty."""
    cloud = clouds.read(inputs.cloud)
    leaves = meshes.read_ply(inputs.leaves[0]) if inputs.leaves else no_mesh()
    found = {
        "shots": shots.read(inputs.shots) if inputs.shots else None,
        "cloud": cloud,
        "leaves": leaves,
        "wood": meshes.read_ply(inputs.wood) if inputs.wood else no_mesh(),
        "points_per_polygon": _points_per_polygon(cloud, leaves, params.polygon_voxel_m),
        "voxels": {
            Path(path).parent.name: as_estimated(voxel_grids.read(path)) for path in inputs.voxels
        },
        "shift_m": SHIFT_M,
    }
    return Evidence(**found, **(_lit(inputs, params) if inputs.light else {}))


def _points_per_polygon(cloud, leaves, voxel_size_m):
    """None where polygons were not made of these points, or leaves were added to them."""
    leafy = cloud.xyz_m[cloud.attributes["Classification"] == LEAF]
    counted = count_points(leafy, voxel_size_m) if voxel_size_m else []
    return counted if len(counted) and len(counted) <= leaves.n_elements else None


def _lit(inputs, params):
    """Light at some times, at the sensors and beside them."""
    sky = netcdf.read(inputs.sky)
    at = np.unique(np.linspace(0, sky.sizes["time"] - 1, TIMES).round().astype(int))
    sky = sky.isel(time=at)
    places = tables.read(inputs.sensors)[["x_m", "y_m", "z_m"]].to_numpy()
    lit, moved = {}, {}
    for path in inputs.light:
        name = Path(path).stem
        lit[name] = netcdf.read(path).isel(time=at)
        grid = [file for file in inputs.voxels if Path(file).parent.name == name]
        found = scene_files.read(grid or inputs.leaves, inputs.wood, params.ground_z_m)
        moved[name] = moved_light(
            (traced.load(scene, params.variant) for scene in found),
            places,
            lit[name],
            sky,
            shift_m=SHIFT_M,
            seed=params.seed,
            sun_diameter_deg=params.sun_diameter_deg,
            aperture_m=params.aperture_m,
        )
    return {
        "light": lit,
        "shifted_light": moved,
        "sensors_m": places,
        "sun_zenith_deg": sky["sun_zenith_deg"].to_numpy(),
        "sun_azimuth_deg": sky["sun_azimuth_deg"].to_numpy(),
        "measured_umol_m2_s": _records(inputs.records) if inputs.records else None,
    }


def _records(path) -> xr.DataArray:
    """Measured PAR by sensor and time."""
    table = tables.read(path)
    table = table[table["reconstruction"] == table["reconstruction"].iloc[0]]
    wide = table.pivot(index="sensor", columns="time", values="measured")
    when = pd.to_datetime(wide.columns, utc=True).tz_localize(None).to_numpy()
    coords = {"sensor": wide.index.to_numpy(str), "time": when}
    return xr.DataArray(wide.to_numpy(), coords, ("sensor", "time"))


if __name__ == "__main__":
    run(main, snakemake)
