"""Grids of a scan survey: what voxels truly hold, and which beams reached them."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from dapple.formats import netcdf


def write(path: str | Path, grids: dict[str, np.ndarray], **attributes) -> None:
    """Write grids (x, y, z) as compressed NetCDF-4, floats as float32; same data, same bytes."""
    dataset = xr.Dataset(
        {name: (("x", "y", "z"), values) for name, values in grids.items()}, attrs=attributes
    )
    packed: dict[str, Any] = {"zlib": True, "complevel": 1}
    encoding = {name: dict(packed) for name in grids}
    for name, values in grids.items():
        if values.dtype.kind == "f":
            encoding[name]["dtype"] = "float32"
    netcdf.store(path, dataset, encoding)
