"""Points in PLY files: ASCII and binary, with CloudCompare's scalar fields."""

from pathlib import Path

import numpy as np

from dapple import frames
from dapple.errors import InputError
from dapple.formats.atomic import atomic
from dapple.formats.cloud_raw import RawCloud, attribute_name

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
NAMES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"}
ORIGIN = "comment origin_m"


def read(path: Path) -> RawCloud:
    """Read the vertices; faces and other elements after them are left alone."""
    with path.open("rb") as handle:
        form, count, fields, origin = _header(path, handle)
        if form == "ascii":
            values = _read_ascii(path, handle, count, fields)
        else:
            order = "<" if form == "binary_little_endian" else ">"
            dtype = np.dtype([(name, order + kind) for name, kind in fields])
            data = handle.read(count * dtype.itemsize)
            if len(data) < count * dtype.itemsize:
                raise _damaged(path, f"{len(data) // dtype.itemsize} of {count} vertices")
            values = np.frombuffer(data, dtype)
    xyz = np.stack([np.asarray(values[axis], float) for axis in "xyz"], axis=1)
    _check_precision(path, xyz, dict(fields))
    attributes = {
        attribute_name(name): np.asarray(values[name]).astype(kind)
        for name, kind in fields
        if name not in "xyz"
    }
    if origin is None:
        return RawCloud(xyz, attributes=attributes)
    return RawCloud(frames.to_local(xyz, origin), origin, attributes, final=True)


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
    header += [f"{ORIGIN} " + " ".join(repr(float(value)) for value in raw.origin_m)]
    header += [f"element vertex {len(table)}", *(f"property double {axis}" for axis in "xyz")]
    header += [
        f"property {NAMES.get(values.dtype.str[1:], 'float')} {name}"
        for name, values in columns.items()
    ]
    with atomic(path) as partial, partial.open("wb") as handle:
        handle.write(("\n".join([*header, "end_header"]) + "\n").encode())
        table.tofile(handle)


def _header(path: Path, handle):
    """Format, number of vertices, their (name, type) pairs, and the origin if one is named."""
    if handle.readline().strip() != b"ply":
        raise _damaged(path, "a first line that is not 'ply'")
    form, count, fields, origin, element = "", None, [], None, ""
    while (line := handle.readline().decode("ascii", "replace").strip()) != "end_header":
        words = line.split()
        if not words:
            raise _damaged(path, "a header without end_header")
        if words[0] == "format":
            form = words[1]
        elif line.startswith(ORIGIN):
            origin = np.array([float(word) for word in words[2:5]])
        elif words[0] == "element":
            element = words[1]
            if count is None and element != "vertex":
                raise _damaged(path, f"element '{element}' before 'vertex'")
            if element == "vertex":
                count = int(words[2])
        elif words[0] == "property" and element == "vertex":
            if words[1] not in TYPES:
                raise _damaged(path, f"vertex property '{' '.join(words[1:])}'")
            fields.append((words[-1], TYPES[words[1]]))
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise _damaged(path, f"format '{form}'")
    if count is None or not {"x", "y", "z"} <= {name for name, _ in fields}:
        raise _damaged(path, "no vertices with x, y and z")
    return form, count, fields, origin


def _read_ascii(path: Path, handle, count: int, fields) -> dict[str, np.ndarray]:
    lines = [line for line, _ in zip(handle, range(count), strict=False)]
    if len(lines) < count:
        raise _damaged(path, f"{len(lines)} of {count} vertices")
    if not count:
        return {name: np.empty(0) for name, _ in fields}
    try:
        table = np.loadtxt(lines, ndmin=2, usecols=range(len(fields)))
    except ValueError as error:
        raise _damaged(path, str(error)) from error
    return {name: table[:, k] for k, (name, _) in enumerate(fields)}


def _check_precision(path: Path, xyz: np.ndarray, kinds: dict[str, str]) -> None:
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


def _damaged(path: Path, found: str) -> InputError:
    return InputError(
        path, found, "a complete PLY file of points", "Export it again, binary little endian."
    )
