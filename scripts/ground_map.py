"""Light on the ground around the tree at a few times."""

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats import netcdf
from dapple.light.timestep_series import Reference
from dapple.scene import scene_files, scene_optics
from dapple.times import spread
from dapple.workflow import run

LIFT_M = 0.01
"""Height of the map above the ground."""


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    sky = netcdf.read(inputs.sky)
    chosen = spread(netcdf.times(sky), params.times, 4, params.timezone)
    # One placement is what stands there at a time; a mean would blur its flecks.
    scene = scene_files.read(inputs.leaves[:1], inputs.wood, params.ground_z_m)[0]
    low, high = scene.bounds_m
    margin = params.margin_m
    x, y = (
        np.arange(low[k] - margin, high[k] + margin, params.spacing_m) + params.spacing_m / 2
        for k in (0, 1)
    )
    north, east = np.meshgrid(y, x, indexing="ij")
    level = np.full(east.size, params.ground_z_m + LIFT_M)
    points = pd.DataFrame({"x_m": east.ravel(), "y_m": north.ravel(), "z_m": level})
    points.insert(0, "sensor", [f"g{k}" for k in range(len(points))])
    at_chosen = sky.isel(time=chosen)
    optics = scene_optics.read(inputs.optics)
    reference = Reference([scene], at_chosen, optics, **params.engine, seed=params.seed)
    series = [reference.at(index, points)["par_umol_m2_s"] for index in range(len(chosen))]
    par = np.stack([one.to_numpy().reshape(east.shape) for one in series])
    par_map = xr.Dataset(
        {
            "par_umol_m2_s": (
                ("time", "y", "x"),
                par,
                {"units": "µmol m-2 s-1", "long_name": "PAR on the ground"},
            )
        },
        coords={
            "time": netcdf.time_coordinate(netcdf.times(at_chosen)),
            "y": ("y", y, {"units": "m", "long_name": "north"}),
            "x": ("x", x, {"units": "m", "long_name": "east"}),
        },
    )
    for name in ("sun_zenith_deg", "sun_azimuth_deg"):
        par_map[name] = at_chosen[name]
    netcdf.write(snakemake.output.map, par_map)


if __name__ == "__main__":
    run(main, snakemake)
