"""Where the local frame lies on the Earth, for files that other programs open."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import xarray as xr

from dapple.formats import json
from dapple.formats.rasters import Raster, horizontal

EASTING = ("False easting", "Easting at false origin", "Easting at projection centre")
NORTHING = ("False northing", "Northing at false origin", "Northing at projection centre")
"""Parameters of projections (EPSG) that shift all coordinates."""
CRS = "crs"
"""Variable that describes the coordinate system (CF conventions, grid mapping)."""


@dataclass(frozen=True)
class WorldFrame:
    """World coordinates of the local origin, and the system that they belong to.

    Attributes
    ----------
    origin_m : (3,) tuple of float
        [m].
    crs : str
        Projected, in metres, as in "EPSG:25832"; empty where it is not known.
    """

    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    crs: str = ""


def at_site(latitude_deg: float, longitude_deg: float) -> str:
    """The system of a frame whose origin stands at a site: a transverse Mercator around it."""
    return (
        f"+proj=tmerc +lat_0={latitude_deg} +lon_0={longitude_deg} +k=1 +x_0=0 +y_0=0 "
        "+datum=WGS84 +units=m +type=crs"
    )


def read(
    cloud: str | Path | None,
    registration: str | Path | None,
    *,
    crs: str = "",
    origin_m: Sequence[float] | None = None,
    site: Mapping[str, float] | None = None,
) -> WorldFrame:
    """The frame of a run.

    Parameters
    ----------
    cloud, registration : path or None
        JSON with `origin_m`, and of the cloud `crs`, where there are such.
    crs : str
        For a cloud that names none.
    origin_m : (3,) sequence of float
        Which is used instead of the cloud's [m].
    site : mapping
        Of a virtual world, which stands there: arguments of `at_site`.
    """
    parts: list[Mapping[str, Any]] = [{"crs": at_site(**site) if site else crs}]
    parts += [json.read(cloud)] if cloud else []
    parts += [{"origin_m": origin_m}]
    parts += [json.read(registration)] if registration else []
    return world_frame(parts)


def world_frame(parts: Sequence[Mapping[str, Any]]) -> WorldFrame:
    """The frame that several sources tell of; the later ones know better.

    Parameters
    ----------
    parts : sequence of mappings
        `origin_m` and `crs`, each where it is known. A system that is not projected in metres
        counts as unknown.
    """
    known: dict[str, Any] = {"origin_m": (0.0, 0.0, 0.0), "crs": ""}
    for part in parts:
        known |= {name: part[name] for name in known if part.get(name)}
    east, north, up = map(float, known["origin_m"])
    return WorldFrame((east, north, up), known["crs"] if _in_metres(known["crs"]) else "")


def local_system(frame: WorldFrame) -> pyproj.CRS | None:
    """The system in which local coordinates are map coordinates: the world's, shifted.

    None where the world's is not known, or its projection has no shift.
    """
    if not frame.crs:
        return None
    described = horizontal(frame.crs).to_json_dict()
    shifts = dict.fromkeys(EASTING, frame.origin_m[0])
    shifts |= dict.fromkeys(NORTHING, frame.origin_m[1])
    found = 0
    for parameter in described["conversion"]["parameters"]:
        if parameter["name"] in shifts:
            parameter["value"] -= shifts[parameter["name"]]
            parameter.pop("id", None)
            found += 1
    described.pop("id", None)
    described["conversion"].pop("id", None)
    described["conversion"]["name"] = "shifted"
    described["name"] += ", shifted to the local origin"
    return pyproj.CRS.from_json_dict(described) if found == 2 else None


def located(dataset: xr.Dataset, frame: WorldFrame) -> xr.Dataset:
    """A dataset with coordinates `x` and `y` in the local frame, and where that lies on the Earth.

    Every variable along them refers to the variable `crs`. Sensors (coordinates along another
    dimension than themselves) get `latitude` and `longitude` besides.

    Parameters
    ----------
    dataset : Dataset
        With coordinates `x` and `y` [m].
    frame : WorldFrame

    Returns
    -------
    Dataset
        The attribute `origin_m` holds the world coordinates of the local origin.
    """
    found = dataset.assign_attrs(origin_m=list(frame.origin_m))
    system = local_system(frame)
    for axis, name in (("x", "east"), ("y", "north")):
        attributes = {"units": "m", "long_name": f"{name} of the local origin"}
        if system is not None:
            attributes |= {"axis": axis.upper()} if found[axis].dims == (axis,) else {}
            attributes["standard_name"] = f"projection_{axis}_coordinate"
        found[axis].attrs.update(attributes)
    if system is None:
        return found
    dimensions = {*found["x"].dims, *found["y"].dims}
    for values in found.data_vars.values():
        if dimensions <= set(values.dims):
            values.attrs["grid_mapping"] = CRS
    found[CRS] = ((), np.int32(0), system.to_cf())
    if found["x"].dims == found["y"].dims:
        found = found.assign_coords(_angles(found, system))
    return found.assign_attrs(world_crs=horizontal(frame.crs).to_string())


def raster(
    values: np.ndarray, x_m: np.ndarray, y_m: np.ndarray, bands: Sequence[str], frame: WorldFrame
) -> Raster:
    """A map in world coordinates.

    Parameters
    ----------
    values : (b, y, x) array
        Rows from south to north.
    x_m, y_m : arrays
        Centres of the cells in the local frame, evenly spaced, equally in both [m].
    bands : sequence of str
    frame : WorldFrame
    """
    pixel_m = float(x_m[1] - x_m[0])
    return Raster(
        values[:, ::-1].astype(np.float32),
        float(x_m[0]) - pixel_m / 2 + frame.origin_m[0],
        float(y_m[-1]) + pixel_m / 2 + frame.origin_m[1],
        pixel_m,
        frame.crs,
        tuple(bands),
    )


def _angles(sensors: xr.Dataset, system: pyproj.CRS) -> dict[str, Any]:
    """Latitude and longitude of sensors."""
    turned = pyproj.Transformer.from_crs(system, "EPSG:4326", always_xy=True)
    longitude, latitude = turned.transform(sensors["x"].to_numpy(), sensors["y"].to_numpy())
    (along,) = sensors["x"].dims
    return {
        name: (along, values, {"units": units, "standard_name": name, "long_name": name})
        for name, values, units in (
            ("latitude", latitude, "degrees_north"),
            ("longitude", longitude, "degrees_east"),
        )
    }


def _in_metres(crs: str) -> bool:
    if not crs:
        return False
    system = horizontal(crs)
    return system.is_projected and all(
        axis.unit_conversion_factor == 1.0 for axis in system.axis_info
    )
