"""Crowns of trees as polygons, from any vector format that GDAL reads."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import geopandas
import numpy as np
import pyogrio
import pyproj
import shapely

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import crown_columns
from dapple.formats.atomic import atomic
from dapple.formats.rasters import horizontal, same_crs

GDAL_ERRORS = (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError)
SIDECARS = (".dbf", ".shx")


@dataclass(frozen=True)
class Crowns:
    """Outlines of trees, and what is known of their leaves.

    Attributes
    ----------
    geometries : tuple of dict
        GeoJSON `Polygon` or `MultiPolygon`, world coordinates [m].
    names : tuple of str
        Trees.
    lcc_ug_cm2 : (n,) float64
        Leaf chlorophyll content [µg cm⁻²]; NaN where it was not measured.
    crs : str
        Coordinate system, as in "EPSG:25832".
    findings : tuple of Finding
        What was noticed while reading.
    """

    geometries: tuple[dict, ...]
    names: tuple[str, ...]
    lcc_ug_cm2: np.ndarray
    crs: str
    findings: tuple[Finding, ...] = ()

    def outlines(self) -> list[np.ndarray]:
        """Outer rings (k, 2) of all polygons, world coordinates [m]."""
        rings = []
        for geometry in self.geometries:
            parts = geometry["coordinates"]
            parts = [parts] if geometry["type"] == "Polygon" else parts
            rings += [np.asarray(part[0], np.float64)[:, :2] for part in parts]
        return rings


def of_rings(
    rings: Sequence[np.ndarray], names: Sequence, lcc_ug_cm2: np.ndarray, crs: str
) -> Crowns:
    """Crowns from one open ring (k, 2) each, world coordinates [m]."""
    polygons = [shapely.Polygon(np.round(ring, 3)) for ring in rings]
    return Crowns(
        tuple(map(_as_json, polygons)),
        tuple(map(str, names)),
        np.asarray(lcc_ug_cm2, float),
        crs,
    )


def write(path: str | Path, crowns: Crowns) -> None:
    """Write GeoJSON that names its coordinate system, as GDAL and QGIS read it."""
    frame = geopandas.GeoDataFrame(
        {"tree": crowns.names, "lcc_ug_cm2": np.round(crowns.lcc_ug_cm2, 3)},
        geometry=[shapely.geometry.shape(geometry) for geometry in crowns.geometries],
        crs=crowns.crs,
    )
    with atomic(path) as partial:
        # RFC 7946 wants longitude and latitude, and would move the crowns.
        pyogrio.write_dataframe(
            frame, partial, driver="GeoJSON", RFC7946="NO", COORDINATE_PRECISION="3"
        )


def read(
    path: str | Path,
    *,
    crs: str = "",
    tree_column: str = "",
    lcc_column: str = "",
    layer: str = "",
) -> Crowns:
    """Read crowns from GeoPackage, Shapefile, GeoJSON or another format that GDAL reads.

    Parameters
    ----------
    path : path
    crs : str
        Projected coordinate system to which they are brought; empty: their own.
    tree_column, lcc_column : str
        Names of the trees and measured leaf chlorophyll [µg cm⁻²]; empty: found by the usual names,
        or trees are numbered and chlorophyll is unknown.
    layer : str
        Of a file with several.

    Raises
    ------
    InputError
        No such file or layer, no polygon left, no coordinate system or one in degrees, or a
        chlorophyll that cannot be one.
    """
    path = Path(path)
    frame = _open(path, layer)
    frame, noticed = _polygons(path, frame)
    frame = frame.to_crs(_target(path, frame, crs))
    names = crown_columns.names(path, frame, tree_column, noticed)
    return Crowns(
        tuple(map(_as_json, frame.geometry)),
        names,
        crown_columns.chlorophyll(path, frame, lcc_column, noticed),
        _authority(frame.crs),
        tuple(noticed),
    )


def within(crowns: Crowns, box_m: Sequence[float], where: str | Path) -> Crowns:
    """Crowns of which a part lies in a box (west, south, east, north) [m].

    Raises
    ------
    InputError
        None does.
    """
    box = shapely.box(*box_m)
    shapes = [shapely.geometry.shape(geometry) for geometry in crowns.geometries]
    inside = np.array([shape.intersects(box) for shape in shapes])
    west, south, east, north = box_m
    if not inside.any():
        left, bottom, right, top = shapely.total_bounds(shapes)
        raise InputError(
            where,
            f"{len(shapes)} crowns from east {left:.1f} to {right:.1f}, north {bottom:.1f} to "
            f"{top:.1f} m",
            f"crowns under the images (east {west:.1f} to {east:.1f}, north {south:.1f} to "
            f"{north:.1f} m)",
            "Give crowns and images of one place; check the coordinate system of both.",
        )
    if inside.all():
        return crowns
    missed = findings.warning(
        where, f"{(~inside).sum()} of {len(inside)} crowns beyond the images", "crowns under them",
        "They are left out.",
    )  # fmt: skip
    kept = np.flatnonzero(inside)
    return replace(
        crowns,
        geometries=tuple(crowns.geometries[k] for k in kept),
        names=tuple(crowns.names[k] for k in kept),
        lcc_ug_cm2=crowns.lcc_ug_cm2[kept],
        findings=(*crowns.findings, missed),
    )


def require_crs(crowns: Crowns, crs: str, where: str | Path) -> None:
    """Raise InputError where crowns and other data have different coordinate systems."""
    if not same_crs(crowns.crs, crs):
        raise InputError(
            where,
            f"crowns in {crowns.crs}",
            f"{crs}, as the images",
            "Reproject the crowns (ogr2ogr -t_srs).",
        )


def _open(path: Path, layer: str) -> geopandas.GeoDataFrame:
    if not path.is_file():
        raise InputError(path, "no file", "crowns", "Check the path in the configuration.")
    if path.suffix.lower() == ".shp":
        missing = [end for end in SIDECARS if not path.with_suffix(end).is_file()]
        if missing:
            raise InputError(
                path,
                f"a Shapefile without its {' and '.join(missing)}",
                "the whole set of files",
                "Copy the files of the same name that lie beside it.",
            )
    try:
        layers = _layers(path)
        if not layer and len(layers) > 1:
            raise InputError(
                path, f"layers {', '.join(layers)}", "one of them", "Name it in `crowns_layer`."
            )
        if layer and layer not in layers:
            raise InputError(
                path, f"layers {', '.join(layers) or 'none'}", f"`{layer}`", "Correct its name."
            )
        with warnings.catch_warnings():
            # GDAL warns of rings that it closes and of files that may be no database: both are
            # judged here.
            warnings.simplefilter("ignore", RuntimeWarning)
            found = pyogrio.read_dataframe(path, layer=layer or None, on_invalid="fix")
    except (*GDAL_ERRORS, shapely.errors.GEOSException, ValueError) as error:
        raise InputError(
            path,
            f"nothing that GDAL reads ({error})",
            "GeoPackage, Shapefile or GeoJSON",
            "Export the file again; its name has to end as its format is.",
        ) from error
    if not isinstance(found, geopandas.GeoDataFrame) or found.empty:
        raise InputError(path, "no features", "crowns as polygons", "Export the polygons again.")
    return found


def _layers(path: Path) -> list[str]:
    """Names of the layers that hold shapes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return [str(name) for name, kind in pyogrio.list_layers(path) if kind is not None]


def _polygons(
    path: Path, frame: geopandas.GeoDataFrame
) -> tuple[geopandas.GeoDataFrame, list[Finding]]:
    """Features that are polygons, mended where a ring crosses itself, in two dimensions."""
    noticed: list[Finding] = []
    shapes = shapely.force_2d(frame.geometry.to_numpy())
    # Corners that are no numbers (a broken file) belong to no shape.
    there = np.isfinite(shapely.bounds(shapes)).all(axis=1)
    crossing = there & ~shapely.is_valid(shapes)
    shapes = np.array(
        [_only_polygons(shape) if ok else None for shape, ok in zip(shapes, there, strict=True)]
    )
    good = np.array([shape is not None and shape.area > 0 for shape in shapes])
    if crossing.any():
        noticed.append(
            findings.warning(
                path,
                f"outlines that cross themselves in {crossing.sum()} features, first "
                f"{int(np.flatnonzero(crossing)[0]) + 1}",
                "simple outlines",
                "They are taken apart where they cross.",
            )
        )
    if not good.any():
        kinds = sorted({str(shape.geom_type) for shape in frame.geometry if shape is not None})
        raise InputError(
            path,
            f"no polygon with an area (found {', '.join(kinds) or 'features without geometry'})",
            "outlines of crowns",
            "Draw the outlines as polygons.",
        )
    if (~good).any():
        noticed.append(
            findings.warning(
                path,
                f"{(~good).sum()} of {len(good)} features without a polygon that has an area",
                "an outline in each",
                "They are left out.",
            )
        )
    kept = frame[good].reset_index(drop=True)
    return kept.set_geometry(geopandas.GeoSeries(shapes[good], crs=frame.crs)), noticed


def _only_polygons(shape: shapely.Geometry) -> shapely.Geometry | None:
    """The polygons of any shape, or None."""
    try:
        parts = shapely.get_parts(shape if shape.is_valid else shapely.make_valid(shape))
    except shapely.errors.GEOSException:  # corners so far apart that they cannot be told
        return None
    while any(part.geom_type == "GeometryCollection" for part in parts):
        parts = np.concatenate([shapely.get_parts(part) for part in parts])
    areas = [part for part in parts if part.geom_type in ("Polygon", "MultiPolygon")]
    return shapely.union_all(areas) if areas else None


def _target(path: Path, frame: geopandas.GeoDataFrame, crs: str) -> pyproj.CRS:
    """The projected system of the result.

    Raises
    ------
    InputError
        The file names none, or degrees where metres stand.
    """
    if frame.crs is None:
        raise InputError(
            path,
            "no coordinate system",
            "one that GDAL finds",
            "Assign the one in which they were drawn (ogr2ogr -a_srs), or add the .prj file.",
        )
    west, south, east, north = frame.total_bounds
    is_geographic = pyproj.CRS(frame.crs).is_geographic
    if is_geographic and (max(abs(west), abs(east)) > 360 or max(abs(south), abs(north)) > 90):
        raise InputError(
            path,
            f"coordinates such as {west:.1f}, {south:.1f} and no projected system",
            "the system in which they were drawn (GeoJSON without one means degrees)",
            "Assign it (ogr2ogr -a_srs EPSG:…).",
        )
    if not crs and is_geographic:
        raise InputError(
            path,
            f"coordinates in {_authority(frame.crs)}",
            "a projected system in metres",
            "Reproject the crowns (ogr2ogr -t_srs).",
        )
    return horizontal(crs or frame.crs)


def _as_json(shape: shapely.Geometry) -> dict:
    """A GeoJSON geometry of lists."""
    mapped = shapely.geometry.mapping(shape)
    return {"type": mapped["type"], "coordinates": _lists(mapped["coordinates"])}


def _lists(values):
    return [_lists(value) for value in values] if isinstance(values, tuple) else values


def _authority(crs: pyproj.CRS) -> str:
    authority = pyproj.CRS(crs).to_authority()
    return ":".join(authority) if authority else pyproj.CRS(crs).to_wkt()
