"""The PLY files that hold meshes: binary, little-endian, triangles."""

from pathlib import Path

import numpy as np

from dapple.errors import InputError
from dapple.formats import ply_elements
from dapple.formats.atomic import atomic

_FACE = np.dtype([("n", "u1"), ("vertex_indices", "<i4", 3), ("element", "<i4")])
PIECE = 1_000_000
"""Faces that are written together."""
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
    with atomic(path) as partial, partial.open("wb") as file:
        file.write(header.encode("ascii"))
        np.ascontiguousarray(vertices, "<f8").tofile(file)
        for at in range(0, len(faces), PIECE):
            rows = slice(at, at + PIECE)
            table = np.empty(len(faces[rows]), _FACE)
            table["n"], table["vertex_indices"], table["element"] = 3, faces[rows], element[rows]
            table.tofile(file)


def read(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Read vertices (v, 3), faces (t, 3), elements (t,) and the origin (3,)."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", _EXPECTED, "Check the path.")
    size = path.stat().st_size
    with path.open("rb") as handle:
        header = ply_elements.read_header(path, handle)
        if header.form != "<":
            kind = "binary_big_endian" if header.form else "ascii"
            raise InputError(path, f"PLY of the kind {kind}", _EXPECTED, _REMEDY)
        tables = {
            element.name: ply_elements.read(path, handle, header.form, element, size)
            for element in header.elements
        }
    origin = np.zeros(3) if header.origin is None else header.origin
    return *_mesh(path, tables), origin


def _mesh(path: Path, tables: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pick vertices, faces and elements from the tables and check that they belong together."""
    vertex, face = tables.get("vertex", {}), tables.get("face", {})
    corners = next((name for name in face if name.startswith("vertex_ind")), None)
    if not {"x", "y", "z"} <= set(vertex) or "face" not in tables:
        raise InputError(path, "no vertices or no faces", _EXPECTED, _REMEDY)
    if corners is None or (len(face[corners]) and face[corners].shape[1] != 3):
        raise InputError(path, "faces that are not triangles", _EXPECTED, _REMEDY)
    vertices = np.stack([vertex[axis].astype(np.float64) for axis in "xyz"], axis=1)
    faces = face[corners].astype(np.int32).reshape(-1, 3)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise InputError(
            path,
            f"faces with the vertex {faces.max() if faces.min() >= 0 else faces.min()}",
            f"vertices 0 to {len(vertices) - 1}",
            _REMEDY,
        )
    element = face.get("element", np.arange(len(faces)))
    return vertices, faces, element.astype(np.int32)
