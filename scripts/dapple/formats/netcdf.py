"""NetCDF datasets after the CF conventions: units and names on every variable, times in UTC."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import InputError
from dapple.formats.atomic import atomic
from dapple.times import utc
from dapple.version import VERSION

TIME_ENCODING = {"units": "milliseconds since 1970-01-01", "dtype": "int64"}
TIME = {
    "long_name": "time",
    "standard_name": "time",
    "axis": "T",
    "time_zone": "UTC",
    "units_metadata": "leap_seconds: none",
}
ABOUT = {
    "Conventions": "CF-1.11",
    "source": f"dapple {VERSION}",
    "history": f"made by dapple {VERSION}",
}


def time_coordinate(times: pd.DatetimeIndex) -> tuple[str, np.ndarray, dict[str, str]]:
    """Coordinate `time` of a dataset: UTC without a zone, which NetCDF cannot hold, and says so.

    Raises
    ------
    InputError
        Naive times.
    """
    naive = utc(times).tz_localize(None).to_numpy()
    return "time", naive, dict(TIME)


def times(dataset: xr.Dataset, where: str | Path = "light dataset") -> pd.DatetimeIndex:
    """Times of a dataset, time-zone aware.

    Raises
    ------
    InputError
        The coordinate `time` does not say that it is UTC.
    """
    if dataset["time"].attrs.get("time_zone") != "UTC":
        raise InputError(
            where,
            "a coordinate `time` without the attribute time_zone",
            'time_zone = "UTC"',
            "Make the coordinate with formats.light.time_coordinate.",
        )
    return pd.DatetimeIndex(dataset["time"].to_numpy()).tz_localize("UTC").as_unit("ns")


def write(path: str | Path, dataset: xr.Dataset) -> None:
    """Write a dataset as NetCDF, whole or not at all.

    Every variable must carry `units` and `long_name` (ValueError otherwise), but for one that
    describes the coordinate system.
    """
    bare = [
        str(name)
        for name, variable in dataset.data_vars.items()
        if not {"units", "long_name"} <= variable.attrs.keys()
        and "grid_mapping_name" not in variable.attrs
    ]
    if bare:
        raise ValueError(f"{path}: no units or long_name on {', '.join(bare)}")
    store(path, dataset, {"time": TIME_ENCODING} if "time" in dataset.coords else {})


def store(path: str | Path, dataset: xr.Dataset, encoding: Mapping[Any, Mapping[str, Any]]) -> None:
    """Write NetCDF-4 with an encoding of each variable, whole or not at all.

    The same dataset gives the same bytes. A title, if it has none, tells its first variable.
    """
    first = next(iter(dataset.data_vars.values()), None)
    title = str(first.attrs.get("long_name", first.name)) if first is not None else "nothing"
    described = dataset.assign_attrs({"title": title} | ABOUT | dataset.attrs)
    # Coordinates are never missing.
    full = {name: {"_FillValue": None} for name in dataset.coords if name not in encoding}
    with atomic(path) as partial:
        described.to_netcdf(partial, engine="netcdf4", encoding=full | dict(encoding))


def read(
    path: str | Path, variables: Sequence[str] = (), attributes: Sequence[str] = ()
) -> xr.Dataset:
    """Read a dataset into memory.

    Parameters
    ----------
    path : path
    variables, attributes : sequence of str
        What the file has to hold.

    Raises
    ------
    InputError
        No such file, not NetCDF, or one of another kind.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "a NetCDF file", "Run the step that makes it.")
    try:
        dataset = xr.load_dataset(path, engine="netcdf4")
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(
            path, f"an unreadable file ({error})", "a NetCDF file", "Delete it and run again."
        ) from error
    missing = [name for name in variables if name not in dataset.variables]
    missing += [name for name in attributes if name not in dataset.attrs]
    if missing:
        raise InputError(
            path,
            f"no {', '.join(missing)}",
            f"a file with {', '.join([*variables, *attributes])}",
            "Delete it and run again; it may come from another version.",
        )
    return dataset
