"""Pair simulated light with what was measured at the same place and time."""

import pandas as pd
import xarray as xr

from dapple.errors import InputError


def pair(
    light: xr.Dataset,
    measured: pd.DataFrame,
    open_sky_umol_m2_s: xr.DataArray | None = None,
    *,
    reconstruction: str,
    clock_offset_s: float = 0.0,
    tolerance_s: float = 30.0,
) -> pd.DataFrame:
    """One record per sensor and simulated time: the nearest measurement in time.

    Parameters
    ----------
    light : Dataset
        Dims `sensor`, `time` (UTC, stored naive); `par_umol_m2_s` and `par_direct_umol_m2_s`.
    measured : DataFrame
        `sensor, time` (UTC, as the loggers' clock showed it), `par_umol_m2_s`.
    open_sky_umol_m2_s : DataArray, optional
        Horizontal PAR without a tree, dim `time`: the baseline.
    reconstruction : str
        Its name.
    clock_offset_s : float
        What the loggers' clock shows minus the true time [s], as the registration found it.
    tolerance_s : float
        Largest distance in time between a simulation and its measurement [s]; half the interval
        between records.

    Returns
    -------
    DataFrame
        `reconstruction, sensor, time` (UTC), `measured, simulated, direct` and, where there is an
        open sky, `baseline`; sorted by sensor and time. Times without a measurement are left out.

    Raises
    ------
    InputError
        Naive times of measurement, or not a single pair.
    """
    if measured["time"].dt.tz is None:
        raise InputError("measured PAR", "naive times", "UTC", "Localise them: tz_localize('UTC').")
    names = {"par_umol_m2_s": "simulated", "par_direct_umol_m2_s": "direct"}
    simulated = light[list(names)].to_dataframe().rename(columns=names).reset_index()
    simulated["time"] = simulated["time"].astype("datetime64[ns]").dt.tz_localize("UTC")
    true_time = measured["time"] - pd.Timedelta(seconds=clock_offset_s)
    known = measured.assign(time=true_time.astype("datetime64[ns, UTC]"))
    known = known.dropna(subset="par_umol_m2_s").rename(columns={"par_umol_m2_s": "measured"})
    records = pd.merge_asof(
        simulated.sort_values("time", kind="stable"),
        known[["sensor", "time", "measured"]].sort_values("time", kind="stable"),
        on="time",
        by="sensor",
        direction="nearest",
        tolerance=pd.Timedelta(seconds=tolerance_s),
    ).dropna(subset="measured")
    if records.empty:
        raise InputError(
            "measured PAR",
            f"no record within {tolerance_s:g} s of a simulated time, "
            f"{len(set(known['sensor']) & set(simulated['sensor']))} sensors in common",
            "records of the simulated sensors in the simulated period",
            "Compare the sensor labels, the days and the time zone of both.",
        )
    if open_sky_umol_m2_s is not None:
        sky = open_sky_umol_m2_s.to_series()
        sky.index = pd.DatetimeIndex(sky.index).as_unit("ns").tz_localize("UTC")
        records["baseline"] = records["time"].map(sky)
    records.insert(0, "reconstruction", reconstruction)
    columns = ["reconstruction", "sensor", "time", "measured", "simulated", "direct"]
    columns += ["baseline"] * (open_sky_umol_m2_s is not None)
    return records.sort_values(["sensor", "time"], ignore_index=True)[columns]


def simulated(light: xr.Dataset, reconstruction: str) -> pd.DataFrame:
    """Simulated light alone as a table of records, where nothing was measured."""
    table = light["par_umol_m2_s"].to_dataframe("simulated").reset_index()
    table["time"] = table["time"].astype("datetime64[ns]").dt.tz_localize("UTC")
    table.insert(0, "reconstruction", reconstruction)
    return table
