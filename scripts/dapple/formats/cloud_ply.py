"""Points in PLY files: ASCII and binary, CloudCompare's scalar fields, ray clouds."""

from pathlib import Path

import numpy as np

from dapple import frames
from dapple.errors import InputError
from dapple.formats import ply_elements
from dapple.formats.atomic import atomic
from dapple.formats.cloud_raw import (
    MISSED,
    Fired,
    RawCloud,
    Source,
    attribute_name,
    columns,
    distinct,
)
from dapple.formats.ply_elements import damaged

NAMES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"}
ORIGIN = "origin_m"
RAY_FIELDS = {"time", "nx", "ny", "nz", "alpha"}
"""Of a ray cloud: the vector from a ray's end back to its start, and 0 where nothing was met."""


def read(path: Path) -> RawCloud:
    """Read the vertices; faces and other elements are left alone, rays that met nothing as well."""
    values, header = _vertices(path)
    xyz = _axes(values, "xyz")
    check_precision(path, xyz, {name: values[name].dtype.str[1:] for name in "xyz"})
    left_out, met = {}, None
    others = [name for name in values if name not in "xyz"]
    if _is_ray_cloud(values):
        met = values["alpha"] > 0
        left_out[MISSED] = int((~met).sum())
        others = [name for name in others if name not in RAY_FIELDS - {"time"}]
        values, xyz = {name: values[name][met] for name in others}, xyz[met]
    names = distinct(attribute_name(name) for name in others)
    attributes: dict[str, np.ndarray] = {}
    for name, found in zip(others, names, strict=True):
        attributes |= columns(found, values[name])
    source = Source(len(xyz) + sum(left_out.values()), left_out=left_out)
    if header.origin is None:
        return RawCloud(xyz, attributes=attributes, source=source)
    local = frames.to_local(xyz, header.origin)
    return RawCloud(local, header.origin, attributes, True, source)


def read_fired(path: Path) -> Fired | None:
    """The rays of a ray cloud as shots; None where the file is none. Rays without length go."""
    values, _ = _vertices(path)
    if not _is_ray_cloud(values):
        return None
    back = _axes(values, ("nx", "ny", "nz"))
    length = np.linalg.norm(back, axis=1)
    good = length > 0
    met = (values["alpha"] > 0)[good]
    start = (_axes(values, "xyz") + back)[good]
    return Fired(
        start,
        -back[good] / length[good, None],
        np.concatenate([[0], np.cumsum(met)]),
        length[good][met],
    )


def _is_ray_cloud(values: dict[str, np.ndarray]) -> bool:
    """Its fields are there, and what would be normals are not of length 1."""
    if not values.keys() >= RAY_FIELDS or not len(values["alpha"]):
        return False
    length = np.linalg.norm(_axes(values, ("nx", "ny", "nz")), axis=1)
    return bool(np.mean(np.abs(length - 1) < 1e-3) < 0.9)


def _axes(values: dict[str, np.ndarray], names) -> np.ndarray:
    return np.stack([np.asarray(values[axis], float) for axis in names], axis=1)


def _vertices(path: Path) -> tuple[dict[str, np.ndarray], ply_elements.Header]:
    """Values of the vertices by property."""
    size = path.stat().st_size
    with path.open("rb") as handle:
        header = ply_elements.read_header(path, handle)
        for element in header.elements:
            if element.name != "vertex":
                ply_elements.skip(path, handle, header.form, element, size)
                continue
            return ply_elements.read(path, handle, header.form, element, size), header
    raise damaged(path, "no vertices")


def write(path: Path, raw: RawCloud) -> None:
    """Write binary little endian: world coordinates as double, attributes as `scalar_<Name>`."""
    columns = {}
    for name, values in raw.attributes.items():
        kind = values.dtype.str[1:]
        columns[f"scalar_{name}"] = values if kind in NAMES else values.astype(np.float32)
    dtype = np.dtype(
        [(axis, "<f8") for axis in "xyz"]
        + [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
    )
    table = np.empty(len(raw.xyz_m), dtype)
    world = frames.to_world(raw.xyz_m, raw.origin_m)
    for axis, name in enumerate("xyz"):
        table[name] = world[:, axis]
    for name, values in columns.items():
        table[name] = values
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"comment {ORIGIN} " + " ".join(repr(float(value)) for value in raw.origin_m)]
    header += [f"element vertex {len(table)}", *(f"property double {axis}" for axis in "xyz")]
    header += [
        f"property {NAMES.get(values.dtype.str[1:], 'float')} {name}"
        for name, values in columns.items()
    ]
    with atomic(path) as partial, partial.open("wb") as handle:
        handle.write(("\n".join([*header, "end_header"]) + "\n").encode())
        table.tofile(handle)


def check_precision(path: Path, xyz: np.ndarray, kinds: dict[str, str]) -> None:
    """Refuse large coordinates in float32: their millimetres are gone already."""
    for axis, name in enumerate("xyz"):
        largest = np.nanmax(np.abs(xyz[:, axis]), initial=0.0)
        if kinds[name] == "f4" and frames.FLOAT32_LIMIT_M < largest < np.inf:
            raise InputError(
                path,
                f"{name} up to {largest:.0f} m in 32-bit floats, {np.spacing(np.float32(largest))}"
                " m apart",
                f"double coordinates, or values below {frames.FLOAT32_LIMIT_M:.0f} m",
                "Export with 'double' coordinates or as LAZ, or subtract an offset before export.",
            )
