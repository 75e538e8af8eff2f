"""Light of sensors whose place on the Earth is told, for other programs."""

import pandas as pd
import xarray as xr

from dapple.formats import georeference
from dapple.formats.georeference import WorldFrame

PHOTON_FLUX = "surface_downwelling_photosynthetic_photon_flux_in_air"
"""Standard name (CF) of PAR."""


def at_sensors(light: xr.Dataset, sensors: pd.DataFrame, frame: WorldFrame) -> xr.Dataset:
    """Light with the place of every sensor, as a collection of time series (CF conventions).

    Parameters
    ----------
    light : Dataset
        As `light_datasets.dataset` makes it.
    sensors : DataFrame
        `sensor`, `x_m`, `y_m`, `z_m` [m] of these sensors at least.
    frame : WorldFrame
        In which they stand.
    """
    places = sensors.set_index("sensor").loc[light["sensor"].to_numpy()]
    height = {"units": "m", "long_name": "height above the local origin", "positive": "up"}
    placed = light.assign_coords(
        x=("sensor", places["x_m"].to_numpy()),
        y=("sensor", places["y_m"].to_numpy()),
        z=("sensor", places["z_m"].to_numpy(), height),
    )
    placed["sensor"].attrs |= {"long_name": "sensor", "cf_role": "timeseries_id"}
    placed["par_umol_m2_s"].attrs["standard_name"] = PHOTON_FLUX
    about = {"title": "light at sensors under a tree", "featureType": "timeSeries"}
    return georeference.located(placed.assign_attrs(about), frame)
