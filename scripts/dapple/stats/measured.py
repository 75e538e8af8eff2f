"""Measured PAR series, from loggers or from a sensor model in a virtual world."""

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import InputError
from dapple.formats.netcdf import times as times_of
from dapple.streams import stream_seed
from dapple.times import parse

MIN_PAR_UMOL_M2_S = -20.0  # offsets of a sensor in the dark
MAX_PAR_UMOL_M2_S = 4000.0  # the sun outside the atmosphere gives about 2700
COLUMNS = ["sensor", "time", "par_umol_m2_s"]


def read(
    path: str | Path,
    *,
    time_column: str = "time_utc",
    par_column: str = "par_umolm2s",
    timezone: str | None = None,
    sensors: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Read PAR records from CSV.

    Parameters
    ----------
    path : path
        Besides the columns below either `sensor` or `logger` and `channel`, which together make
        the label `logger_channel`.
    time_column, par_column : str
        Times (see `times.parse`) and photon flux [µmol m⁻² s⁻¹].
    timezone : str or None
        IANA zone of times without an offset; a column that ends in `_utc` needs none.
    sensors : pandas.DataFrame or None
        The sensor table, where every recorded sensor must be found.

    Returns
    -------
    pandas.DataFrame
        `sensor` (text), `time` (UTC), `par_umol_m2_s`, by sensor as they first appear and by
        time. Rows without a value are left out, exact repetitions are read once.

    Raises
    ------
    InputError
        No file or column, unreadable or naive times, two values for one sensor and time,
        impossible values, or sensors that the table does not know.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "a CSV table of PAR records", "Check the path.")
    raw = pd.read_csv(path, dtype={"sensor": str, "logger": str, "channel": str})
    labels = {"sensor"} if "sensor" in raw else {"logger", "channel"}
    if missing := sorted({time_column, par_column, *labels} - set(raw.columns)):
        raise InputError(
            path,
            f"columns {', '.join(map(str, raw.columns))}",
            f"columns {', '.join(missing)}",
            "Name the columns in the configuration.",
        )
    label = raw["sensor"] if "sensor" in raw else raw["logger"] + "_" + raw["channel"]
    records = pd.DataFrame(
        {
            "sensor": label.str.strip(),
            "time": parse(raw[time_column], path, timezone),
            "par_umol_m2_s": pd.to_numeric(raw[par_column], errors="coerce"),
        }
    )
    records = records.dropna().drop_duplicates(ignore_index=True)
    _check_records(records, path)
    if sensors is not None:
        check_sensors(records, sensors, path)
    return _sorted(records)


def check_sensors(
    records: pd.DataFrame, sensors: pd.DataFrame, where: str | Path = "PAR records"
) -> None:
    """Make sure that every recorded sensor has a position.

    Raises
    ------
    InputError
        Lists the sensors that are in the records and not in the table.
    """
    known = set(sensors["sensor"])
    unknown = [name for name in records["sensor"].unique() if name not in known]
    if unknown:
        raise InputError(
            where,
            f"records of {len(unknown)} sensors without a position: {', '.join(unknown[:12])}"
            + (" …" if len(unknown) > 12 else ""),
            f"labels of the sensor table, such as {sensors['sensor'].iloc[0]}",
            "Add their positions or remove their records; labels are logger_channel.",
        )


def coverage(records: pd.DataFrame) -> pd.DataFrame:
    """What each sensor's series covers.

    Returns
    -------
    pandas.DataFrame
        `sensor, n, first, last, step_s, missing, longest_gap_s`: the step is the median time
        between records, and `missing` the number of records that it leaves out.
    """
    rows = []
    for sensor, series in records.groupby("sensor", sort=False):
        time = series["time"].sort_values()
        gaps_s = time.diff().dropna().dt.total_seconds().to_numpy()
        step_s = float(np.median(gaps_s)) if len(gaps_s) else np.nan
        missing = int((np.round(gaps_s / step_s) - 1).clip(min=0).sum()) if len(gaps_s) else 0
        longest_s = float(gaps_s.max()) if len(gaps_s) else 0.0
        first, last = time.iloc[0], time.iloc[-1]
        rows.append((sensor, len(series), first, last, step_s, missing, longest_s))
    names = ["sensor", "n", "first", "last", "step_s", "missing", "longest_gap_s"]
    return pd.DataFrame(rows, columns=names)


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


def _sorted(records: pd.DataFrame) -> pd.DataFrame:
    order = {label: k for k, label in enumerate(records["sensor"].unique())}
    rank = records["sensor"].map(order)
    return (
        records.assign(rank=rank)
        .sort_values(["rank", "time"], kind="stable", ignore_index=True)
        .drop(columns="rank")[COLUMNS]
    )


def _check_records(records: pd.DataFrame, path: Path) -> None:
    if records.empty:
        raise InputError(path, "no record", "at least one value", "Is the file complete?")
    repeated = records.duplicated(["sensor", "time"])
    if repeated.any():
        row = records[repeated].iloc[0]
        raise InputError(
            path,
            f"two values of sensor {row['sensor']} at {row['time']}",
            "one record per sensor and time",
            "Remove one of them.",
        )
    wrong = ~records["par_umol_m2_s"].between(MIN_PAR_UMOL_M2_S, MAX_PAR_UMOL_M2_S)
    if wrong.any():
        row = records[wrong].iloc[0]
        raise InputError(
            path,
            f"{row['par_umol_m2_s']:g} µmol m⁻² s⁻¹ of sensor {row['sensor']} at {row['time']}",
            f"{MIN_PAR_UMOL_M2_S:g} to {MAX_PAR_UMOL_M2_S:g}",
            "Check the calibration and the unit, or remove the record.",
        )
