"""NetCDF of simulated images: what was traced per pixel, and the fit of Semi-LESS."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from dapple.formats import netcdf
from dapple.retrieval.coefficients import Coefficients, Window
from dapple.retrieval.semiless import Fitted
from dapple.scene.counters import KINDS, Counters

TABLES = {
    "table": (("pixel", "column"), "sums of functions over the paths of each pixel, sun then sky"),
    "orders": (("kind", "order"), "what each kind of path met, counted"),
    "values": (("kind", "function"), "functions of each kind of path"),
    "light": (("source", "kind"), "reflectance factor that a kind brings to the whole image"),
    "cells": (("replicate", "cell", "column"), "means of the table over cells"),
}
NUMBERS = ("cell_m", "n_paths", "max_orders", "cut_weight", "sun_cosine")
WINDOW = ("left_m", "top_m", "pixel_m", "rows", "columns")
CHUNK_PIXELS = 16384


def write(path: str | Path, coefficients: Coefficients) -> None:
    """Write what was traced, whole or not at all; the same numbers give the same bytes."""
    variables = {
        name: (dims, getattr(coefficients, name), {"units": "1", "long_name": text})
        for name, (dims, text) in TABLES.items()
    }
    attributes = {name: getattr(coefficients, name) for name in NUMBERS}
    attributes |= coefficients.counters.attributes
    _write(path, variables, coefficients.window, attributes)


def read(path: str | Path) -> Coefficients:
    """Read what `write` wrote.

    Raises
    ------
    InputError
        No such file, or one of another kind.
    """
    dataset = netcdf.read(path, [*TABLES], [*NUMBERS, *KINDS, *WINDOW])
    numbers = {name: dataset.attrs[name].item() for name in NUMBERS}
    tables: dict[str, Any] = {name: dataset[name].to_numpy() for name in TABLES}
    counters = Counters.from_attributes(dataset.attrs)
    return Coefficients(window=_window(dataset), counters=counters, **tables, **numbers)


def write_semiless(path: str | Path, fitted: Fitted) -> None:
    """Write the fit of Semi-LESS, whole or not at all."""
    variables = {
        "terms": (
            ("source", "term", "power", "pixel"),
            fitted.terms,
            {"units": "1", "long_name": "rho_so, T1, rho_dd, rho_dd T2: powers of leaf albedo"},
        ),
        "diffuse_share": (
            "band",
            fitted.diffuse_share,
            {"units": "1", "long_name": "share of the light that comes from the sky"},
        ),
    }
    _write(path, variables, fitted.window, {})


def read_semiless(path: str | Path) -> Fitted:
    """Read what `write_semiless` wrote; raises as `read`."""
    dataset = netcdf.read(path, ["terms", "diffuse_share"], WINDOW)
    return Fitted(
        _window(dataset), dataset["terms"].to_numpy(), dataset["diffuse_share"].to_numpy()
    )


def _write(path: str | Path, variables: dict, window: Window, attributes: dict) -> None:
    attributes = attributes | {name: getattr(window, name) for name in WINDOW}
    dataset = xr.Dataset(variables, attrs=attributes)
    encoding: dict[Any, dict[str, Any]] = {}
    for name, variable in dataset.data_vars.items():
        sizes = zip(variable.dims, variable.shape, strict=True)
        chunks = [min(n, CHUNK_PIXELS) if dim == "pixel" else n for dim, n in sizes]
        encoding[name] = {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks}
    netcdf.store(path, dataset, encoding)


def _window(dataset: xr.Dataset) -> Window:
    left, top, pixel, rows, columns = (np.asarray(dataset.attrs[name]).item() for name in WINDOW)
    return Window(left, top, pixel, int(rows), int(columns))
