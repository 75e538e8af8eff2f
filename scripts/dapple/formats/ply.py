"""The PLY files that hold meshes: binary, little-endian, triangles."""

from pathlib import Path

import numpy as np

from dapple.errors import InputError
from dapple.formats.atomic import atomic

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "<i2"),
    **dict.fromkeys(("ushort", "uint16"), "<u2"),
    **dict.fromkeys(("int", "int32"), "<i4"),
    **dict.fromkeys(("uint", "uint32"), "<u4"),
    **dict.fromkeys(("float", "float32"), "<f4"),
    **dict.fromkeys(("double", "float64"), "<f8"),
}
_FACE = np.dtype([("n", "u1"), ("vertex_indices", "<i4", 3), ("element", "<i4")])
_EXPECTED = "a binary little-endian PLY with vertices and triangles"
_REMEDY = "Write the mesh again, or convert it (CloudCompare: -M_EXPORT_FMT PLY)."


def write(
    path: str | Path,
    vertices: np.ndarray,
    faces: np.ndarray,
    element: np.ndarray,
    origin_m: np.ndarray,
) -> None:
    """Write vertices (v, 3), faces (t, 3) and the element (t,) of each face."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        "comment dapple: metres, x east, y north, z up\n"
        f"comment origin_m {' '.join(repr(float(value)) for value in origin_m)}\n"
        f"element vertex {len(vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\n"
        "property list uchar int vertex_indices\nproperty int element\nend_header\n"
    )
    table = np.empty(len(faces), _FACE)
    table["n"], table["vertex_indices"], table["element"] = 3, faces, element
    with atomic(path) as partial, partial.open("wb") as file:
        file.write(header.encode("ascii"))
        file.write(np.ascontiguousarray(vertices, "<f8").tobytes())
        file.write(table.tobytes())


def read(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Read vertices (v, 3), faces (t, 3), elements (t,) and the origin (3,)."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", _EXPECTED, "Check the path.")
    data = path.read_bytes()
    head, mark, body = data.partition(b"end_header\n")
    lines = head.decode("ascii", "replace").split("\n")
    if lines[0].strip() != "ply" or not mark:
        raise InputError(path, "no PLY header", _EXPECTED, _REMEDY)
    layout, origin = _layout(path, lines[1:])
    tables, at = {}, 0
    for name, size, dtype in layout:
        if at + size * dtype.itemsize > len(body):
            raise InputError(
                path,
                f"{len(body)} bytes after the header, too few for its {size} × {name}",
                _EXPECTED,
                "The file is truncated: copy or make it again.",
            )
        tables[name] = np.frombuffer(body, dtype, size, at)
        at += size * dtype.itemsize
    return *_mesh(path, tables), origin


def _layout(path: Path, lines: list[str]) -> tuple[list[tuple[str, int, np.dtype]], np.ndarray]:
    """What the header says is in the file: tables in order, and the origin."""
    tables: list[tuple[str, int, list]] = []
    origin = np.zeros(3)
    for line in lines:
        words = line.split()
        try:
            match words:
                case ["format", kind, _] if kind != "binary_little_endian":
                    raise InputError(path, f"PLY of the kind {kind}", _EXPECTED, _REMEDY)
                case ["comment", "origin_m", *values]:
                    origin = np.array([float(value) for value in values])
                case ["element", name, size]:
                    tables.append((name, int(size), []))
                case ["property", "list", count, item, name]:
                    # Lists of one known length are tables; the length is checked afterwards.
                    tables[-1][2].append((f"{name}_n", _TYPES[count]))
                    tables[-1][2].append((name, _TYPES[item], 3))
                case ["property", kind, name]:
                    tables[-1][2].append((name, _TYPES[kind]))
        except (KeyError, IndexError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(path, f"the header line `{line}`", _EXPECTED, _REMEDY) from error
    return [(name, size, np.dtype(fields)) for name, size, fields in tables], origin


def _mesh(path: Path, tables: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pick vertices, faces and elements from the tables and check that they belong together."""
    vertex, face = tables.get("vertex"), tables.get("face")
    fields = face.dtype.names if face is not None else ()
    corners = next((name for name in fields or () if name.startswith("vertex_ind")), None)
    if vertex is None or corners is None or not {"x", "y", "z"} <= set(vertex.dtype.names or ()):
        raise InputError(path, "no vertices or no faces", _EXPECTED, _REMEDY)
    if len(face) and not (face[corners.removesuffix("_n") + "_n"] == 3).all():
        raise InputError(path, "faces that are not triangles", _EXPECTED, _REMEDY)
    corners = corners.removesuffix("_n")
    vertices = np.stack([vertex[axis].astype(np.float64) for axis in "xyz"], axis=1)
    faces = face[corners].astype(np.int32)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise InputError(
            path,
            f"faces with the vertex {faces.max() if faces.min() >= 0 else faces.min()}",
            f"vertices 0 to {len(vertices) - 1}",
            _REMEDY,
        )
    has_element = "element" in face.dtype.names
    element = face["element"].astype(np.int32) if has_element else np.arange(len(face))
    return vertices, faces, element.astype(np.int32)
