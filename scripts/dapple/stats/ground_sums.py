"""Light on the ground, summed over the day, and as maps for geographic information systems."""

import numpy as np
import xarray as xr

from dapple.formats import georeference, netcdf
from dapple.formats.georeference import WorldFrame
from dapple.formats.rasters import Raster
from dapple.stats.daily_light import integral_mol_m2

PAR, SUM = "par_umol_m2_s", "par_sum_mol_m2_d"
"""Maps by the hour, and their sum over a day."""


def with_sum(maps: xr.Dataset, timezone: str) -> xr.Dataset:
    """Maps by the hour with what they add up to between the first and the last of a day.

    Parameters
    ----------
    maps : Dataset
        As `light.par_on_ground` makes them.
    timezone : str
        By whose clock days are told.

    Returns
    -------
    Dataset
        With `par_sum_mol_m2_d` (y, x), the mean over days; NaN where a day has one map alone.
    """
    par = maps[PAR].transpose("y", "x", "time")
    cells = par.to_numpy().reshape(-1, par.sizes["time"])
    total = integral_mol_m2(cells, netcdf.times(maps).tz_convert(timezone))
    about = {
        "units": "mol m-2 d-1",
        "long_name": "PAR on the ground, summed from the first to the last map of a day",
    }
    return maps.assign({SUM: (("y", "x"), total.reshape(par.shape[:2]), about)})


def raster(maps: xr.DataArray, frame: WorldFrame) -> Raster:
    """One map, or one band a time, in world coordinates."""
    if "time" not in maps.dims:
        maps, bands = maps.expand_dims("band"), [SUM]
    else:
        times = maps["time"].to_numpy()
        bands = [f"{PAR} {time}Z" for time in np.datetime_as_string(times, unit="m")]
    return georeference.raster(
        maps.transpose(..., "y", "x").to_numpy(),
        maps["x"].to_numpy(),
        maps["y"].to_numpy(),
        bands,
        frame,
    )
