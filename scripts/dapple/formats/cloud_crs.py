"""The coordinate system of a LAS or LAZ file, in metres and without its heights."""

from pathlib import Path

import laspy
import pyproj

from dapple.errors import InputError

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
    if own is None and stated is None:
        raise InputError(
            path,
            "no coordinate system in the header",
            "a projected one in metres",
            "Write it into the file (pdal translate in.laz out.laz --writers.las.a_srs=EPSG:25832) "
            "or name it as chlorophyll.crowns.crs.",
        )
    chosen = own or stated
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
        with laspy.open(path) as reader:
            return reader.header.parse_crs()
    except pyproj.exceptions.CRSError as error:
        raise InputError(
            path,
            f"a coordinate system that cannot be read ({error})",
            "WKT or GeoTIFF keys of a known system",
            "Write it anew with PDAL's writers.las.a_srs.",
        ) from error
    # laspy and its back ends raise many kinds of error on damaged files.
    except Exception as error:
        raise InputError(
            path, f"a damaged file ({error})", "a LAS or LAZ file", "Copy or export it again."
        ) from error


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
