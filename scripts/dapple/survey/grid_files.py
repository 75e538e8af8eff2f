"""Grids of a scan survey: what voxels truly hold, and which beams reached them."""

from pathlib import Path

import numpy as np
import xarray as xr

from dapple.errors import InputError
from dapple.formats.atomic import atomic


def write(path: str | Path, grids: dict[str, np.ndarray], **attributes) -> None:
    """Write grids (x, y, z) as compressed NetCDF-4, floats as float32; same data, same bytes."""
    dataset = xr.Dataset(
        {name: (("x", "y", "z"), values) for name, values in grids.items()}, attrs=attributes
    )
    encoding = {name: {"zlib": True, "complevel": 1} for name in grids}
    for name, values in grids.items():
        if values.dtype.kind == "f":
            encoding[name]["dtype"] = "float32"
    with atomic(path) as partial:
        dataset.to_netcdf(partial, engine="netcdf4", encoding=encoding)


def read(path: str | Path) -> xr.Dataset:
    """Read grids into memory.

    Raises
    ------
    InputError
        The file is missing or no readable NetCDF.
    """
    try:
        with xr.open_dataset(Path(path), engine="netcdf4") as opened:
            return opened.load()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(
            path, f"no readable grids ({error})", "NetCDF of a survey", "Make it again."
        ) from error
