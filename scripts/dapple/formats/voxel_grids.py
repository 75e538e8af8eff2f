"""Voxel grids of plant area density as xarray datasets: NetCDF and AMAPVox's text."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import InputError
from dapple.formats import netcdf
from dapple.formats.atomic import atomic

_EXPECTED = "voxels with `plant_area_density_m2_m3` (x, y, z) and the attribute `voxel_size_m`"
_REMEDY = "Make the voxels again; the file may be truncated or of another kind."

# AMAPVox's column: our variable, and what to multiply with.
_COLUMNS = {
    "nbEchos": ("n_hits", 1.0),
    "nbSampling": ("n_shots", 1.0),
    "lgTotal": ("path_length_m", 1.0),
    "angleMean": ("mean_zenith_deg", 1.0),
    "bsEntering": ("entering", 1.0),
    "bsIntercepted": ("intercepted", 1.0),
}


def write(path: str | Path, dataset: xr.Dataset) -> None:
    """Write NetCDF-4, compressed; floating-point variables as float32.

    Coordinates stay float64. The same dataset gives the same bytes.
    """
    encoding: dict[Any, dict[str, Any]] = {}
    for name, values in dataset.data_vars.items():
        encoding[name] = {"zlib": True, "complevel": 2, "shuffle": True}
        if values.dtype.kind == "f":
            encoding[name] |= {"dtype": "float32", "_FillValue": np.float32("nan")}
    netcdf.store(path, dataset, encoding)


def read(path: str | Path) -> xr.Dataset:
    """Read voxels into memory.

    Raises
    ------
    InputError
        The file is missing, cannot be read, or is no voxel grid.
    """
    dataset = netcdf.read(path)
    pad = dataset.get("plant_area_density_m2_m3")
    if pad is None or set(pad.dims) != {"x", "y", "z"} or "voxel_size_m" not in dataset.attrs:
        raise InputError(
            path, f"variables {', '.join(map(str, dataset.data_vars))}", _EXPECTED, _REMEDY
        )
    return dataset


def write_vox(path: str | Path, dataset: xr.Dataset) -> None:
    """Write AMAPVox's text format, which its R package opens with `readVoxelSpace`.

    One line a voxel, `k` (z) running fastest, in the local frame. `PadBVTotal` is the density
    chosen, `NaN` where unknown; `ground_distance` is the height of the voxel's centre above the
    grid's lowest facet; `transmittance` and the `attenuation_*` columns are per metre at G = 0.5
    (for other leaf angles too, so that AMAPVox's PAD with spherical leaves is ours).
    """
    data = dataset.transpose("x", "y", "z")
    shape = data["plant_area_density_m2_m3"].shape
    size = float(data.attrs["voxel_size_m"])
    corner = np.array([float(data[axis][0]) - size / 2 for axis in "xyz"])
    index = np.indices(shape).reshape(3, -1)
    table = {name: index[k] for k, name in enumerate("ijk")}
    table["ground_distance"] = np.round((index[2] + 0.5) * size, 6)
    for column, (name, factor) in _COLUMNS.items():
        if name in data:
            table[column] = data[name].to_numpy().ravel() * factor
    table |= _attenuation(data)
    table["PadBVTotal"] = data["plant_area_density_m2_m3"].to_numpy().ravel()
    for column in ("nbEchos", "nbSampling"):
        if column in table:
            table[column] = table[column].astype(np.int64)
    # The reader takes a key and a value from each line and splits at the colon: one a line.
    header = (
        "VOXEL SPACE\n"
        f"#min_corner:{_vector(corner)}\n"
        f"#max_corner:{_vector(corner + np.array(shape) * size)}\n"
        f"#split:({', '.join(str(n) for n in shape)})\n"
        f"#res:{_vector(np.full(3, size))}\n"
        "#type:TLS\n"
        f"#max_pad:{float(data.attrs.get('max_pad_m2_m3', 5.0))}\n"
        f"#lad_type:{str(data.attrs.get('leaf_angle_distribution', 'spherical')).capitalize()}\n"
        "#fraction-digits:7\n"
        "#build-version:dapple\n"
    )
    with atomic(path) as partial, partial.open("w", encoding="ascii", newline="\n") as file:
        file.write(header)
        pd.DataFrame(table).to_csv(
            file, sep=" ", index=False, na_rep="NaN", float_format="%.7g", lineterminator="\n"
        )


def _attenuation(data: xr.Dataset) -> dict[str, np.ndarray]:
    """AMAPVox's estimator columns from our densities."""
    columns = {}
    if "pad_transmittance_m2_m3" in data:
        columns["transmittance"] = np.exp(-0.5 * data["pad_transmittance_m2_m3"].to_numpy().ravel())
    for column, name in (
        ("attenuation_FPL_biasedMLE", "pad_fpl_biased_m2_m3"),
        ("attenuation_FPL_unbiasedMLE", "pad_fpl_m2_m3"),
        ("attenuation_PPL_MLE", "pad_ppl_m2_m3"),
    ):
        if name in data:
            columns[column] = 0.5 * data[name].to_numpy().ravel()
    return columns


def read_vox(path: str | Path) -> xr.Dataset:
    """Read AMAPVox's text format: its columns as variables (x, y, z), density under our name.

    Raises
    ------
    InputError
        The file is missing, is no voxel space, or has fewer voxels than its header says.
    """
    path = Path(path)
    expected = "an AMAPVox voxel file (`VOXEL SPACE`, `#key:value` lines, a table)"
    if not path.is_file():
        raise InputError(path, "no file", expected, "Check the path.")
    head: dict[str, str] = {}
    n_head = 1
    with path.open(encoding="utf-8", errors="replace") as file:
        first = file.readline().strip()
        while (line := file.readline()).startswith("#"):
            n_head += 1
            head |= dict(part.strip().split(":", 1) for part in line.split("#")[1:] if ":" in part)
    if first != "VOXEL SPACE" or not {"min_corner", "split", "res"} <= head.keys():
        raise InputError(path, f"`{first[:40]}` and keys {sorted(head)}", expected, _REMEDY)
    try:
        corner, split, size = (_numbers(head[key]) for key in ("min_corner", "split", "res"))
        shape = tuple(int(n) for n in split)
        table = pd.read_csv(path, sep=" ", skiprows=n_head, encoding_errors="replace")
        index = table[["i", "j", "k"]].to_numpy(dtype=np.int64).T
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(path, " ".join(str(error).split())[:200], expected, _REMEDY) from error
    if "PadBVTotal" not in table or len(table) != math.prod(shape):
        found = f"{len(table)} voxels with columns {', '.join(map(str, table.columns))}"
        raise InputError(path, found, f"{math.prod(shape)} with i, j, k, PadBVTotal", _REMEDY)
    if len(np.unique(index, axis=1).T) != len(table) or not _inside(index, shape):
        raise InputError(path, "voxels twice or outside the space", expected, _REMEDY)
    density = pd.to_numeric(table["PadBVTotal"], errors="coerce")
    if (density < 0).any() or np.isinf(density).any():
        worst = int(np.flatnonzero((density < 0) | np.isinf(density))[0])
        found = f"a plant area density of {density[worst]:g} in row {worst + 1} of the table"
        raise InputError(path, found, "0 or more, or NaN where it is not known", _REMEDY)
    at = np.ravel_multi_index(index, shape)
    data = {}
    for name in table.columns.difference(["i", "j", "k"]):
        known = table[name].to_numpy()
        values = np.empty(len(table), known.dtype)
        values[at] = known
        new = "plant_area_density_m2_m3" if name == "PadBVTotal" else str(name)
        data[new] = (("x", "y", "z"), values.reshape(shape))
    coords = {a: corner[k] + (np.arange(shape[k]) + 0.5) * size[k] for k, a in enumerate("xyz")}
    return xr.Dataset(data, coords, {"voxel_size_m": float(size[0]), "header": str(head)})


def _inside(index: np.ndarray, shape: tuple[int, ...]) -> bool:
    """Whether indices (3, n) are those of voxels."""
    return bool(((index >= 0) & (index < np.array(shape)[:, None])).all())


def _vector(values: np.ndarray) -> str:
    return f"({', '.join(f'{value:.10g}' for value in values)})"


def _numbers(text: str) -> np.ndarray:
    """Three numbers as AMAPVox writes them: in brackets or not, with commas or spaces, or one."""
    values = [float(word) for word in text.strip("()[]{} ").replace(",", " ").split()]
    if len(values) not in (1, 3) or not np.isfinite(values).all():
        raise ValueError(f"`{text.strip()}`, which are not three numbers")
    return np.array(values * 3 if len(values) == 1 else values)
