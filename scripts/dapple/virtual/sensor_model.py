"""Records that sensors would make of light that is known."""

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats.netcdf import times as times_of
from dapple.streams import stream_seed

COLUMNS = ["sensor", "time", "par_umol_m2_s"]


def simulate(
    light: xr.Dataset,
    *,
    noise_relative: float = 0.02,
    noise_umol_m2_s: float = 2.0,
    calibration_relative: float = 0.0,
    clock_offset_s: float = 0.0,
    seed: int,
) -> pd.DataFrame:
    """Records that sensors would make in a virtual world.

    Parameters
    ----------
    light : xarray.Dataset
        `par_umol_m2_s` (sensor, time): the true light.
    noise_relative, noise_umol_m2_s : float
        Standard deviation of a record: share of the light, and constant [µmol m⁻² s⁻¹].
    calibration_relative : float
        Standard deviation of the factor by which a whole sensor errs.
    clock_offset_s : float
        How far the loggers' clock is ahead [s]: a record stamped t saw the light of t minus
        this, linear between the times of `light`.
    seed : int
        Each sensor has its own stream, named after its label.

    Returns
    -------
    pandas.DataFrame
        `sensor`, `time` (UTC), `par_umol_m2_s` ≥ 0 at the times of `light`; stamps whose light
        lies outside the series are left out.
    """
    times = times_of(light)
    stamps_s = (times - times[0]).total_seconds().to_numpy() if len(times) else np.zeros(0)
    seen_s = stamps_s - clock_offset_s
    kept = (seen_s >= stamps_s.min(initial=0)) & (seen_s <= stamps_s.max(initial=0))
    par = light["par_umol_m2_s"].transpose("sensor", "time").to_numpy()
    tables = []
    for label, series in zip(light["sensor"].to_numpy().astype(str), par, strict=True):
        rng = np.random.default_rng(stream_seed(seed, "measured", label))
        gain = 1.0 + calibration_relative * rng.standard_normal()
        relative, constant = rng.standard_normal((2, len(series)))
        true = np.interp(seen_s, stamps_s, series) * gain
        record = true * (1.0 + noise_relative * relative) + noise_umol_m2_s * constant
        values = np.maximum(record, 0.0)[kept]
        tables.append(pd.DataFrame(dict(zip(COLUMNS, (label, times[kept], values), strict=True))))
    return pd.concat(tables, ignore_index=True)
