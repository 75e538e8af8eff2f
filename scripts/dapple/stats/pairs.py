"""Pair simulated light with what was measured at the same place and time."""

import numpy as np
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
    """Simulated and measured light of the same sensor and time.

    A record that is a mean over an interval is held against the mean of the simulated light over
    it, linear between its times. A sample of a moment, or a mean over less than a simulated step,
    is held against the nearest simulated time.

    Parameters
    ----------
    light : Dataset
        Dims `sensor`, `time` (UTC, stored naive); `par_umol_m2_s` and `par_direct_umol_m2_s`.
    measured : DataFrame
        `sensor, time` (UTC, as the loggers' clock showed it; the middle of an interval),
        `par_umol_m2_s` and, where there are intervals, `interval_s`.
    open_sky_umol_m2_s : DataArray, optional
        Horizontal PAR without a tree, dim `time`: the baseline.
    reconstruction : str
        Its name.
    clock_offset_s : float
        What the loggers' clock shows minus the true time [s], as the registration found it.
    tolerance_s : float
        Largest distance in time between a simulation and a sample [s].

    Returns
    -------
    DataFrame
        `reconstruction, sensor, time` (UTC), `measured, simulated, direct` and, where there is an
        open sky, `baseline`; sorted by sensor and time. Times without a measurement are left out,
        and intervals that reach beyond the simulated times.

    Raises
    ------
    InputError
        Naive times of measurement, or not a single pair.
    """
    if measured["time"].dt.tz is None:
        raise InputError("measured PAR", "naive times", "UTC", "Localise them: tz_localize('UTC').")
    known = measured.dropna(subset="par_umol_m2_s").rename(columns={"par_umol_m2_s": "measured"})
    true_time = known["time"] - pd.Timedelta(seconds=clock_offset_s)
    known = known.assign(time=true_time.astype("datetime64[ns, UTC]"))
    if "interval_s" not in known:
        known["interval_s"] = 0.0
    step_s = _step_s(light)
    is_mean = known["interval_s"] >= max(step_s, 1e-9)
    series = light[["par_umol_m2_s", "par_direct_umol_m2_s"]].rename(
        par_umol_m2_s="simulated", par_direct_umol_m2_s="direct"
    )
    if open_sky_umol_m2_s is not None:
        series["baseline"] = open_sky_umol_m2_s.reset_coords(drop=True)
    records = pd.concat(
        [
            _nearest(series, known[~is_mean], tolerance_s),
            _over_intervals(series, known[is_mean]),
        ],
        ignore_index=True,
    )
    if records.empty:
        raise InputError(
            "measured PAR",
            f"no record within {tolerance_s:g} s of a simulated time, "
            f"{len(set(known['sensor']) & set(light['sensor'].to_numpy().astype(str)))} sensors in "
            "common",
            "records of the simulated sensors in the simulated period",
            "Compare the sensor labels, the days and the time zone of both.",
        )
    records.insert(0, "reconstruction", reconstruction)
    columns = ["reconstruction", "sensor", "time", "measured", "simulated", "direct"]
    columns += ["baseline"] * (open_sky_umol_m2_s is not None)
    return records.sort_values(["sensor", "time"], ignore_index=True)[columns]


def _step_s(light: xr.Dataset) -> float:
    times = light["time"].to_numpy().astype("datetime64[ns]").astype(np.int64)
    return float(np.median(np.diff(times))) / 1e9 if len(times) > 1 else np.inf


def _nearest(series: xr.Dataset, known: pd.DataFrame, tolerance_s: float) -> pd.DataFrame:
    """One record per sensor and simulated time: the nearest in time, or whose interval holds it."""
    table = series.to_dataframe().reset_index()
    table["time"] = table["time"].astype("datetime64[ns]").dt.tz_localize("UTC")
    longest_s = float(known["interval_s"].max()) if len(known) else 0.0
    return pd.merge_asof(
        table.sort_values("time", kind="stable"),
        known[["sensor", "time", "measured"]].sort_values("time", kind="stable"),
        on="time",
        by="sensor",
        direction="nearest",
        tolerance=pd.Timedelta(seconds=max(tolerance_s, 0.5 * longest_s)),
    ).dropna(subset="measured")


def _over_intervals(series: xr.Dataset, known: pd.DataFrame) -> pd.DataFrame:
    """Means of the simulated series over the interval of every record."""
    times = series["time"].to_numpy().astype("datetime64[ns]").astype(np.int64) / 1e9
    parts = []
    for sensor, rows in known.groupby("sensor", sort=False):
        if sensor not in series["sensor"]:
            continue
        middle = rows["time"].astype("datetime64[ns, UTC]").astype(np.int64).to_numpy() / 1e9
        half = 0.5 * rows["interval_s"].to_numpy()
        first, last = middle - half, middle + half
        inside = (first >= times[0] - 0.5) & (last <= times[-1] + 0.5)
        one = series.sel(sensor=sensor)
        part = rows.loc[inside, ["sensor", "time", "measured"]].copy()
        for name in series:
            values = one[name].to_numpy().astype(float)
            part[name] = interval_means(times, values, first[inside], last[inside])
        parts.append(part)
    return pd.concat(parts, ignore_index=True) if parts else known.iloc[:0]


def interval_means(
    times: np.ndarray, values: np.ndarray, first: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Exact means (n,) over intervals of a series that is linear between its times."""
    first, last = (np.clip(edge, times[0], times[-1]) for edge in (first, last))
    steps = np.diff(times)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)])

    def up_to(moment: np.ndarray) -> np.ndarray:
        left = np.clip(np.searchsorted(times, moment, side="right") - 1, 0, len(steps) - 1)
        into = moment - times[left]
        slope = (values[left + 1] - values[left]) / steps[left]
        return integral[left] + values[left] * into + 0.5 * slope * into**2

    return (up_to(last) - up_to(first)) / (last - first)


def measured(records: pd.DataFrame) -> xr.DataArray:
    """Measured PAR of the sensors and times of a table of records, as (sensor, time).

    Parameters
    ----------
    records : DataFrame
        As `pair` gives it; every reconstruction has the same measurements.
    """
    return of_sensors(records, records["reconstruction"].iloc[0], "measured")


def of_sensors(records: pd.DataFrame, reconstruction: str, column: str) -> xr.DataArray:
    """A column of the records of one reconstruction, as (sensor, time)."""
    one = records[records["reconstruction"] == reconstruction]
    wide = one.pivot(index="sensor", columns="time", values=column)
    when = pd.to_datetime(wide.columns, utc=True).tz_localize(None).to_numpy()
    coords = {"sensor": wide.index.to_numpy(str), "time": when}
    return xr.DataArray(wide.to_numpy(), coords, ("sensor", "time"))


def simulated(light: xr.Dataset, reconstruction: str) -> pd.DataFrame:
    """Simulated light alone as a table of records, where nothing was measured."""
    table = light["par_umol_m2_s"].to_dataframe("simulated").reset_index()
    table["time"] = table["time"].astype("datetime64[ns]").dt.tz_localize("UTC")
    table.insert(0, "reconstruction", reconstruction)
    return table
