"""LAS and LAZ, read in chunks, written as 1.4 with point format 6."""

from collections.abc import Iterator
from datetime import date
from pathlib import Path

import laspy
import numpy as np
import pyproj

from dapple import frames
from dapple.errors import InputError
from dapple.formats import cloud_crs, cloud_las_extra, cloud_las_header, cloud_laz
from dapple.formats.atomic import atomic
from dapple.formats.cloud_las_extra import ExtraField
from dapple.formats.cloud_las_header import Header
from dapple.formats.cloud_raw import RawCloud, Source, joined

STANDARD = {
    "Intensity": "intensity",
    "ReturnNumber": "return_number",
    "NumberOfReturns": "number_of_returns",
    "Classification": "classification",
    "Synthetic": "synthetic",
    "Withheld": "withheld",
    "PointSourceId": "point_source_id",
    "UserData": "user_data",
    "GpsTime": "gps_time",
    "Red": "red",
    "Green": "green",
    "Blue": "blue",
}
FIELDS = {*STANDARD, "ScanAngle"}
WRITABLE = FIELDS - {"Red", "Green", "Blue"}
SCAN_ANGLE_STEP_DEG = 0.006
"""Step of the field `scan_angle` of point formats 6 to 10; older ones count whole degrees."""
SAME_DAY = date(2000, 1, 1)
"""In every header: the same points are the same bytes on any day."""
VLR_USER, VLR_ID = "dapple", 1
"""Names the standard fields that mean something: LAS cannot tell class 0 from never classified."""

FAR = 100.0
"""Bounds so many times as wide as the first points are spread are no bounds of these points."""
CHUNK = 1_000_000
MOST_BYTES = 1 << 26
"""Of a chunk in memory: points may be as long as 65,535 bytes."""


def read(path: Path) -> RawCloud:
    """Read a whole LAS or LAZ file, chunk by chunk."""
    header = cloud_las_header.read(path)
    named = _declared(header)
    pieces, origin_m = [], np.zeros(3)
    for raw in _chunks(path, header, CHUNK):
        fields = raw.attributes.items()
        used = {n: v for n, v in fields if not named or n in named or n not in FIELDS}
        pieces.append({"xyz": raw.xyz_m} | used)
        origin_m = raw.origin_m
    n = sum(len(piece["xyz"]) for piece in pieces)
    crs, units, notes = cloud_crs.describe(header.records)
    step = float(header.scale[:2].max())
    source = Source(n, crs, units, step, notes=(*notes, *_notes(header)))
    if not pieces:
        return RawCloud(np.empty((0, 3)), source=source)
    attributes = joined(pieces)
    xyz = attributes.pop("xyz")
    # A field that is 0 everywhere was never filled, unless the file says that it was.
    kept = {
        name: values
        for name, values in attributes.items()
        if named or name not in FIELDS or values.any()
    }
    return RawCloud(xyz, origin_m, kept, True, source)


def iterate(path: Path, chunk: int) -> Iterator[RawCloud]:
    """Chunks of at most `chunk` points with one origin and all fields."""
    yield from _chunks(path, cloud_las_header.read(path), chunk)


def write(path: Path, raw: RawCloud, scale_m: float = 1e-4, crs: str | None = None) -> None:
    """Write LAS 1.4, point format 6; LAZ by suffix.

    Attributes without a field in the point format become extra dimensions: float32 where that
    holds the numbers, integers as they are. `crs` names the coordinate system, as "EPSG:25832".
    """
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.creation_date = SAME_DAY
    header.offsets, header.scales = raw.origin_m, np.full(3, scale_m)
    header.generating_software = "dapple"
    header.global_encoding.wkt = True  # point formats 6 to 10 ask for it, PDAL complains without
    if crs is not None:
        header.add_crs(pyproj.CRS(crs))
    extra = {name: _storable(v) for name, v in raw.attributes.items() if name not in WRITABLE}
    header.add_extra_dims([laspy.ExtraBytesParams(n, v.dtype) for n, v in extra.items()])
    for described in header.vlrs.get("ExtraBytesVlr"):
        for one in described.extra_bytes_structs:  # laspy takes a single point's value for both
            one.options &= ~(one.MIN_BIT_MASK | one.MAX_BIT_MASK)
    names = ",".join(name for name in raw.attributes if name in WRITABLE)
    header.vlrs.append(laspy.VLR(VLR_USER, VLR_ID, "fields in use", f"{names},".encode()))
    farthest_m = max(-raw.xyz_m.min(initial=0.0), raw.xyz_m.max(initial=0.0))
    if np.rint(farthest_m / scale_m) > np.iinfo(np.int32).max:
        raise InputError(
            path,
            f"a point {farthest_m:.0f} m from the local origin",
            f"at most {np.iinfo(np.int32).max * scale_m:.0f} m at a step of {scale_m} m",
            "Use a coarser step, or an origin nearer to the points.",
        )
    kept = {
        name: extra[name] if name in extra else _stored(path, name, values)
        for name, values in raw.attributes.items()
    }
    with atomic(path) as partial, laspy.open(partial, "w", header=header) as writer:
        for at in range(0, len(raw.xyz_m), CHUNK):
            rows = slice(at, at + CHUNK)
            writer.write_points(
                _record(header, raw.xyz_m[rows], {n: values[rows] for n, values in kept.items()})
            )


def _record(
    header: laspy.LasHeader, xyz_m: np.ndarray, attributes: dict[str, np.ndarray]
) -> laspy.ScaleAwarePointRecord:
    record = laspy.ScaleAwarePointRecord.zeros(len(xyz_m), header=header)
    for axis, name in enumerate("XYZ"):
        record[name] = np.rint(xyz_m[:, axis] / header.scales[axis]).astype(np.int32)
    for name in ("return_number", "number_of_returns"):
        record[name] = np.ones(len(xyz_m), np.uint8)
    for name, values in attributes.items():
        field = "scan_angle" if name == "ScanAngle" else STANDARD.get(name, name)
        record[field if name in WRITABLE else name] = values
    return record


def _stored(path: Path, name: str, values: np.ndarray) -> np.ndarray:
    if name == "ScanAngle":
        return np.rint(values / SCAN_ANGLE_STEP_DEG).astype(np.int16)
    return _whole(path, name, values)


def _storable(values: np.ndarray) -> np.ndarray:
    if values.dtype == bool:
        return values.astype(np.uint8)
    if values.dtype != np.float64:
        return values
    finite = values[np.isfinite(values)]
    fits = not finite.size or np.abs(finite).max() <= np.finfo(np.float32).max
    return values.astype(np.float32) if fits else values


def _whole(path: Path, name: str, values: np.ndarray) -> np.ndarray:
    """Values for an integer field of the point format, refused where they would be cut."""
    if name == "GpsTime":
        return values
    largest = {"ReturnNumber": 15, "NumberOfReturns": 15, "Classification": 255, "UserData": 255}
    limit = largest.get(name, 65535)
    values = np.asarray(values)
    wrong = ~((values >= 0) & (values <= limit) & (values == np.rint(values)))
    if wrong.any():
        raise InputError(
            path,
            f"{name} = {values[wrong][0]}",
            f"whole numbers from 0 to {limit}, as LAS holds them",
            f"Scale or rename '{name}'.",
        )
    return values.astype(np.uint16 if limit == 65535 else np.uint8)


def _chunks(path: Path, header: Header, chunk: int) -> Iterator[RawCloud]:
    """Points of each chunk with every field."""
    kind = laspy.PointFormat(header.point_format)
    if n_extra := header.record_bytes - kind.size:
        kind.add_extra_dimension(laspy.ExtraBytesParams("extra", f"{n_extra}u1"))
    origin, fields = None, _extra_fields(header, n_extra)[0]
    chunk = max(1, min(chunk, MOST_BYTES // header.record_bytes))
    blocks = cloud_laz.blocks if header.compressed else cloud_laz.plain_blocks
    for block in blocks(path, header, chunk):
        points = laspy.PackedPointRecord.from_buffer(block, kind)
        if origin is None:
            origin = _origin(header, points)
        yield _chunk(points, header, origin, fields)


def _extra_fields(header: Header, n_extra: int) -> tuple[list[ExtraField], tuple[str, ...]]:
    records = header.records.get(cloud_las_header.EXTRA_BYTES, [])
    return cloud_las_extra.describe(records, n_extra, FIELDS)


def _notes(header: Header) -> tuple[str, ...]:
    n_extra = header.record_bytes - laspy.PointFormat(header.point_format).size
    return (*header.notes, *_extra_fields(header, n_extra)[1])


def _origin(header: Header, points: laspy.PackedPointRecord) -> np.ndarray:
    """The file's offset, unless coordinates from there are too large for float32.

    The bounds in the header tell how large they are. Where the first points (n) lie beyond them, or
    nowhere near them, they are wrong, and these points tell.
    """
    corners = np.stack([header.low, header.high])
    ends = np.array([[points[axis].min(), points[axis].max()] for axis in "XYZ"], float)
    first = ends.T * header.scale + header.offset
    slack_m = header.scale
    within = (first[0] >= corners[0] - slack_m) & (first[1] <= corners[1] + slack_m)
    span_m = np.ptp(corners, axis=0)
    absurd = (span_m > frames.FLOAT32_LIMIT_M) & (span_m > FAR * np.ptp(first, axis=0))
    if not within.all() or absurd.any():
        corners = first
    offset = header.offset + 0.0
    if offset.any() and np.abs(corners - offset).max() <= frames.FLOAT32_LIMIT_M:
        return offset
    return frames.choose_origin(corners)


def _chunk(points, header: Header, origin: np.ndarray, fields: list[ExtraField]) -> RawCloud:
    xyz = np.empty((len(points), 3))
    shift = header.offset - origin
    for axis, name in enumerate("XYZ"):
        np.multiply(points[name], header.scale[axis], out=xyz[:, axis])
        if shift[axis]:
            xyz[:, axis] += shift[axis]
    present = set(points.point_format.dimension_names)
    attributes = {n: np.array(points[f]) for n, f in STANDARD.items() if f in present}
    if "scan_angle" in present:
        attributes["ScanAngle"] = np.float32(SCAN_ANGLE_STEP_DEG) * np.array(points["scan_angle"])
    elif "scan_angle_rank" in present:
        attributes["ScanAngle"] = np.array(points["scan_angle_rank"], np.float32)
    for field in fields:
        extra = np.asarray(points.array["extra"]).reshape(len(points), -1)
        attributes |= cloud_las_extra.values(extra, field)
    return RawCloud(xyz, origin, attributes, final=True)


def _declared(header: Header) -> set[str]:
    """Standard fields that the file says are in use; empty for files that do not say."""
    for record in header.records.get((VLR_USER, VLR_ID), []):
        return set(record.decode("ascii", "replace").split(","))
    return set()
