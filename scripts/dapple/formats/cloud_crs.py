"""The coordinate system of a LAS or LAZ file, its units, and its name without heights."""

import contextlib
import struct
from collections.abc import Mapping
from pathlib import Path

import pyproj
from pyproj.crs import CompoundCRS

from dapple.errors import InputError
from dapple.formats import cloud_las_header
from dapple.formats.cloud_raw import Units

USER, WKT, GEO_KEYS = "LASF_Projection", 2112, 34735
PROJECTED, GEOGRAPHIC, VERTICAL, LINEAR, VERTICAL_LINEAR = 3072, 2048, 4096, 3076, 4099
"""Numbers of GeoTIFF keys."""
LINEAR_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
"""Metre, international foot and foot of the US survey, by EPSG number."""

REPROJECT = (
    "Reproject the cloud into a projected system in metres, for example with `pdal translate in.laz"
    " out.laz reprojection --filters.reprojection.out_srs=EPSG:25832`."
)


def horizontal(path: str | Path, declared: str = "") -> str:
    """Coordinate system of east and north.

    Parameters
    ----------
    path : str or Path
        LAS or LAZ.
    declared : str
        For a file that names no system, as in "EPSG:25832"; a file that names one has to agree.

    Returns
    -------
    str
        "EPSG:..." where it has such a number, else WKT.

    Raises
    ------
    InputError
        There is no system, an unknown one, one in degrees or feet (east, north or heights), or one
        that differs from the declared one.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "a point cloud", "Check the path in the configuration.")
    own = _in_header(path)
    stated = None if not declared else _parse("chlorophyll.crowns.crs", declared)
    chosen = own or stated
    if chosen is None:
        raise InputError(
            path,
            "no coordinate system in the header",
            "a projected one in metres",
            "Write it into the file (pdal translate in.laz out.laz --writers.las.a_srs=EPSG:25832) "
            "or name it as chlorophyll.crowns.crs.",
        )
    _check_metres(path, chosen)
    flat = _flat(chosen)
    if own is not None and stated is not None and not flat.equals(_flat(stated), True):
        raise InputError(
            path,
            f"coordinate system {_name(flat)}",
            f"{declared} (chlorophyll.crowns.crs)",
            "Leave chlorophyll.crowns.crs empty, or reproject the cloud.",
        )
    return _name(flat)


def _in_header(path: Path) -> pyproj.CRS | None:
    """The file's own system; a record that cannot be read is an error, not a missing one."""
    try:
        return of_records(cloud_las_header.read(path).records)
    except pyproj.exceptions.CRSError as error:
        raise InputError(
            path,
            f"a coordinate system that cannot be read ({error})",
            "WKT or GeoTIFF keys of a known system",
            "Write it anew with PDAL's writers.las.a_srs.",
        ) from error


def of_records(records: Mapping[tuple[str, int], list[bytes]]) -> pyproj.CRS | None:
    """The coordinate system that the records of a LAS file name: WKT before GeoTIFF keys.

    Raises
    ------
    pyproj.exceptions.CRSError
        There is one that pyproj does not know.
    """
    for record in records.get((USER, WKT), []):
        if text := record.decode("utf-8", "replace").strip("\0 \n"):
            return pyproj.CRS.from_wkt(text)
    keys = _geo_keys(records)
    horizontal = next((keys[k] for k in (PROJECTED, GEOGRAPHIC) if _is_epsg(keys.get(k, 0))), None)
    if horizontal is None:
        return None
    crs = pyproj.CRS.from_epsg(horizontal)
    if _is_epsg(keys.get(VERTICAL, 0)):
        with contextlib.suppress(pyproj.exceptions.CRSError):  # heights alone may be unknown
            return CompoundCRS(f"{crs.name} + height", [crs, pyproj.CRS.from_epsg(keys[VERTICAL])])
    return crs


def describe(records: Mapping[tuple[str, int], list[bytes]]) -> tuple[str, Units, tuple[str, ...]]:
    """Name of the coordinate system of a LAS file, its units, and notes; an unknown one is a note.

    Returns
    -------
    name : str
        "EPSG:…" or WKT; empty where there is none or none that can be read.
    units : Units
    notes : tuple of str
    """
    try:
        crs = of_records(records)
    except pyproj.exceptions.CRSError as error:
        said = " ".join(str(error).split())[:120]
        return "", Units(), (f"The coordinate system of the file cannot be read ({said}).",)
    keys = _geo_keys(records)
    found = Units() if crs is None else units(crs)
    if crs is None or not (found.degrees or found.geocentric):
        across = LINEAR_UNITS.get(keys.get(LINEAR, 0), found.horizontal_m)
        own = crs is not None and crs.is_compound
        up = found.vertical_m if own else LINEAR_UNITS.get(keys.get(VERTICAL_LINEAR, 0), across)
        found = Units(across, up)
    return ("" if crs is None else _name(crs)), found, ()


def units(crs: pyproj.CRS) -> Units:
    """Metres of a unit of east and north and of a unit of height, or that they are degrees."""
    flat = _flat(crs)
    if flat.is_geographic:
        return Units(degrees=True)
    if flat.is_geocentric:
        return Units(geocentric=True)
    across = flat.axis_info[0].unit_conversion_factor if flat.axis_info else 1.0
    heights = [a.unit_conversion_factor for a in crs.axis_info if a.direction == "up"]
    # A system without heights: they are in the same unit.
    return Units(across, heights[0] if heights else across)


def _geo_keys(records: Mapping[tuple[str, int], list[bytes]]) -> dict[int, int]:
    """GeoTIFF keys that hold a number themselves."""
    keys = {}
    for record in records.get((USER, GEO_KEYS), []):
        words = struct.unpack(f"<{len(record) // 2}H", record[: len(record) // 2 * 2])
        for at in range(4, len(words) - 3, 4):
            key, location, _, value = words[at : at + 4]
            if location == 0:
                keys[key] = value
    return keys


def _is_epsg(code: int) -> bool:
    return 1024 <= code <= 32766


def _parse(where: str, text: str) -> pyproj.CRS:
    try:
        return pyproj.CRS(text)
    except pyproj.exceptions.CRSError as error:
        raise InputError(
            where, f"'{text}'", "a coordinate system, as in EPSG:25832", "Correct it."
        ) from error


def _check_metres(path: Path, crs: pyproj.CRS) -> None:
    flat = _flat(crs)
    if flat.is_geographic or flat.is_geocentric:
        raise InputError(
            path, f"coordinates in {_name(flat)}", "a projected system in metres", REPROJECT
        )
    for axis in crs.axis_info:
        if abs(axis.unit_conversion_factor - 1.0) > 1e-9:
            raise InputError(
                path, f"{axis.name.lower()} in {axis.unit_name}", "coordinates in metres", REPROJECT
            )


def _flat(crs: pyproj.CRS) -> pyproj.CRS:
    return crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()


def _name(crs: pyproj.CRS) -> str:
    authority = crs.to_authority()
    return ":".join(authority) if authority else crs.to_wkt()
