"""PAR on the ground at the times of a slider, with the sun."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dapple.formats import netcdf
from dapple.report import packing
from dapple.report.blocks import Block, Chart
from dapple.report.run_light import RunLight


def blocks(run: RunLight, folder: Path) -> Iterator[Block]:
    """The map of every stored time, one shown at a time."""
    path = folder / "light/ground_map.nc"
    if not path.is_file():
        return
    found = netcdf.read(path).transpose("time", "y", "x")
    par = found["par_umol_m2_s"].to_numpy()
    data = {
        "x_m": found["x"].to_numpy().round(3).tolist(),
        "y_m": found["y"].to_numpy().round(3).tolist(),
        "times": packing.local(netcdf.times(found), run.timezone),
        "timezone": run.timezone,
        "par": packing.light(par),
        "top": float(np.nanmax(par)),
        "height_deg": (90 - found["sun_zenith_deg"].to_numpy()).round(1).tolist(),
        "azimuth_deg": found["sun_azimuth_deg"].to_numpy().round(1).tolist(),
        "sensors": run.sensors["sensor"].tolist(),
        "sensor_x_m": run.sensors["x_m"].round(3).tolist(),
        "sensor_y_m": run.sensors["y_m"].round(3).tolist(),
    }
    yield Chart(
        "ground",
        "ground",
        "PAR on the ground below the polygons. Move the slider: sun, shade and flecks of light "
        "move with the hour, here and in the view of the tree. Circles are sensors; the sun stands "
        "at the edge.",
        data,
    )
