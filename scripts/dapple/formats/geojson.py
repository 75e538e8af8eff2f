"""Crowns of field trees as GeoJSON in a projected coordinate system."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj

from dapple.errors import InputError
from dapple.formats.atomic import atomic
from dapple.formats.rasters import same_crs

WITHOUT_CRS = "EPSG:4326"
"""What RFC 7946 says of a file that names no system: longitude and latitude."""


@dataclass(frozen=True)
class Crowns:
    """Outlines of trees whose leaf chlorophyll was measured.

    Attributes
    ----------
    geometries : tuple of dict
        GeoJSON `Polygon` or `MultiPolygon`, world coordinates [m].
    names : tuple of str
        Trees.
    lcc_ug_cm2 : (n,) float64
        Leaf chlorophyll content [µg cm⁻²].
    crs : str
        Coordinate system, as in "EPSG:25832".
    """

    geometries: tuple[dict, ...]
    names: tuple[str, ...]
    lcc_ug_cm2: np.ndarray
    crs: str

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
    geometries = []
    for ring in rings:
        closed = np.round(np.concatenate([ring, ring[:1]]), 3).tolist()
        geometries.append({"type": "Polygon", "coordinates": [closed]})
    return Crowns(tuple(geometries), tuple(map(str, names)), np.asarray(lcc_ug_cm2, float), crs)


def write(path: str | Path, crowns: Crowns) -> None:
    """Write GeoJSON with the coordinate system as a `crs` member, as GDAL and QGIS read it."""
    authority, code = crowns.crs.split(":")
    features = [
        {
            "type": "Feature",
            "properties": {"tree": name, "lcc_ug_cm2": round(float(lcc), 3)},
            "geometry": geometry,
        }
        for geometry, name, lcc in zip(
            crowns.geometries, crowns.names, crowns.lcc_ug_cm2, strict=True
        )
    ]
    content = {
        "type": "FeatureCollection",
        "crs": {"type": "name", "properties": {"name": f"urn:ogc:def:crs:{authority}::{code}"}},
        "features": features,
    }
    with atomic(path) as partial:
        partial.write_text(json.dumps(content, indent=1) + "\n")


def read(path: str | Path) -> Crowns:
    """Read crowns: features with the properties `lcc_ug_cm2` and, where there is one, `tree`.

    Raises
    ------
    InputError
        No such file, no GeoJSON, no feature, one that is no polygon or has no chlorophyll, or no
        coordinate system in metres (without a `crs` member GeoJSON means longitude and latitude).
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "GeoJSON", "Check the path in the configuration.")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(
            path, f"no readable JSON ({error})", "GeoJSON", "Export the file again."
        ) from error
    features = content.get("features") if isinstance(content, dict) else None
    if not features:
        raise InputError(
            path, "no features", "a FeatureCollection of crowns", "Export the polygons again."
        )
    crs = _crs(path, content)
    for number, feature in enumerate(features, start=1):
        _check(path, number, feature)
    return Crowns(
        tuple(feature["geometry"] for feature in features),
        tuple(str(f["properties"].get("tree", n)) for n, f in enumerate(features, start=1)),
        np.array([float(feature["properties"]["lcc_ug_cm2"]) for feature in features]),
        crs,
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


def _crs(path: Path, content: dict) -> str:
    member = content.get("crs") or {"properties": {"name": WITHOUT_CRS}}
    name = str(member.get("properties", {}).get("name", ""))
    try:
        crs = pyproj.CRS(name)
    except pyproj.exceptions.CRSError as error:
        raise InputError(
            path, f"coordinate system '{name}'", "one that PROJ knows", "Correct the crs member."
        ) from error
    if not crs.is_projected:
        raise InputError(
            path,
            f"coordinates in {name}" + ("" if content.get("crs") else " (no crs member)"),
            "a projected system in metres, named in a crs member",
            "Reproject the crowns (ogr2ogr -t_srs) or add the member.",
        )
    authority = crs.to_authority()
    return ":".join(authority) if authority else crs.to_wkt()


def _check(path: Path, number: int, feature: dict) -> None:
    kind = (feature.get("geometry") or {}).get("type")
    if kind not in ("Polygon", "MultiPolygon"):
        raise InputError(
            path, f"a {kind} as feature {number}", "Polygon or MultiPolygon", "Draw its outline."
        )
    lcc = (feature.get("properties") or {}).get("lcc_ug_cm2")
    try:
        known = lcc is not None and 0 < float(lcc) < 200
    except (TypeError, ValueError):
        known = False
    if not known:
        raise InputError(
            path,
            f"lcc_ug_cm2 = {lcc} in feature {number}",
            "leaf chlorophyll above 0, in µg cm⁻², in every feature",
            "Add the property, or leave the crown out.",
        )
