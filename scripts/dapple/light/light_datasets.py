"""Light at sensors and times as a dataset: its variables, and what they are called."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats.netcdf import time_coordinate
from dapple.light.series import Light

PARTS = {
    "par_umol_m2_s": "photosynthetically active radiation",
    "par_direct_umol_m2_s": "PAR straight from the sun",
    "par_sky_umol_m2_s": "PAR straight from the sky",
    "par_scattered_umol_m2_s": "PAR scattered by leaves, bark and ground",
    "standard_error_umol_m2_s": "standard error of simulated PAR, by rays and placements of leaves "
    "alone: not its distance from the truth",
}


def as_dataset(light: Light, sensors: Sequence[str], when: pd.DatetimeIndex) -> xr.Dataset:
    """Light of labelled sensors at t times as files have it."""
    parts = {name: getattr(light, name) for name in ("direct", "sky", "scattered")}
    return dataset(list(sensors), when, par=light.par, standard_error=light.standard_error, **parts)


def dataset(
    sensors: list[str],
    when: pd.DatetimeIndex,
    *,
    par: np.ndarray,
    direct: np.ndarray,
    sky: np.ndarray,
    scattered: np.ndarray,
    standard_error: np.ndarray,
) -> xr.Dataset:
    """Light at sensors and times, arrays of shape (n_sensors, t), as a dataset."""
    values = (par, direct, sky, scattered, standard_error)
    return xr.Dataset(
        {
            name: (("sensor", "time"), value, {"units": "µmol m-2 s-1", "long_name": text})
            for (name, text), value in zip(PARTS.items(), values, strict=True)
        },
        coords={"sensor": sensors, "time": time_coordinate(when)},
    )
