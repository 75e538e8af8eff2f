"""NetCDF of counted paths."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from dapple.formats import netcdf
from dapple.light.tensor import Transport
from dapple.optics.responses import COSINE, Response
from dapple.scene.counters import KINDS, Counters

ROWS = {
    "sensor": "index of the sensor where the paths start",
    "replicate": "independent set of paths",
    "patch": "sky patch in which they leave",
    "orders": "counted on their way",
    "count": "paths",
}
SENSORS = {
    "n_paths": "paths started from the sensor in each replicate",
    "cut": "paths given up at max_orders, of all replicates",
}
IDENTITY = "what the sensor's light depends on, as a number"
SKY = "what the sensor reads of the sky patch over what a level one in the open reads of it"


def write(path: str | Path, transport: Transport, identities: np.ndarray) -> None:
    """Write counted paths, whole or not at all; the same counts give the same bytes.

    Parameters
    ----------
    path : path
    transport : Transport
    identities : (n_sensors,) uint64
        Of its sensors, see `by_sensor.identities`.
    """
    variables: dict[str, tuple[Any, np.ndarray, dict[str, str]]] = {
        name: (
            ("row", "order") if name == "orders" else "row",
            getattr(transport, name),
            {"units": "1", "long_name": text},
        )
        for name, text in ROWS.items()
    }
    variables |= {
        name: ("start", getattr(transport, name), {"units": "1", "long_name": text})
        for name, text in SENSORS.items()
    }
    variables["identity"] = ("start", identities, {"units": "1", "long_name": IDENTITY})
    about = {"units": "1", "long_name": SKY}
    variables["sky_seen"] = (("start", "set", "sky_patch"), transport.sky_seen, about)
    variables["orders"][2]["long_name"] += ": " + ", ".join(transport.counters.names)
    attributes: dict[str, Any] = {"max_orders": transport.max_orders}
    attributes |= transport.counters.attributes
    if transport.response != COSINE:
        attributes["response"] = np.ravel(transport.response)
    dataset = xr.Dataset(variables, attrs=attributes)
    compressed = {"zlib": True, "complevel": 1, "shuffle": True}
    netcdf.store(path, dataset, dict.fromkeys(variables, compressed))


def read(path: str | Path) -> tuple[np.ndarray, Transport]:
    """Read identities of sensors and counted paths as `write` writes them.

    Raises
    ------
    InputError
        No such file, or one of another kind.
    """
    names = [*ROWS, *SENSORS, "sky_seen"]
    dataset = netcdf.read(path, [*names, "identity"], ("max_orders", *KINDS))
    columns = {name: dataset[name].to_numpy() for name in names}
    counters = Counters.from_attributes(dataset.attrs)
    return dataset["identity"].to_numpy(), Transport(
        **columns,
        max_orders=int(dataset.attrs["max_orders"]),
        counters=counters,
        response=_response(dataset),
    )


def _response(dataset: xr.Dataset) -> Response:
    """Of the sensors; files of sensors that respond to the cosine say nothing about it."""
    if "response" not in dataset.attrs:
        return COSINE
    return tuple(map(tuple, dataset.attrs["response"].reshape(-1, 2).tolist()))
