"""Wavefront OBJ of polygons, in the axes of LESS, DART or the local frame."""

import math
from pathlib import Path

import numpy as np

from dapple import frames
from dapple.errors import InputError
from dapple.formats.atomic import atomic

_EXPECTED = "a Wavefront OBJ of polygons (lines `v x y z` and `f i j k ...`)"


def to_axes(xyz_m: np.ndarray, axes: str) -> np.ndarray:
    """Turn local coordinates (n, 3) to the axes of `less`, `dart` or `local`."""
    return _turn(xyz_m, axes, "local_to_{}")


def from_axes(xyz_m: np.ndarray, axes: str) -> np.ndarray:
    """Turn coordinates (n, 3) in the axes of `less`, `dart` or `local` to the local frame."""
    return _turn(xyz_m, axes, "{}_to_local")


def _turn(xyz_m: np.ndarray, axes: str, name: str) -> np.ndarray:
    if axes == "local":
        return np.asarray(xyz_m, np.float64)
    if axes not in ("less", "dart"):
        raise InputError("axes", f"`{axes}`", "less, dart or local", "Name the axes of the file.")
    return getattr(frames, name.format(axes))(xyz_m)


def write(path: str | Path, vertices: np.ndarray, polygons: list[np.ndarray], axes: str) -> None:
    """Write vertices (n, 3) to 0.01 mm, and faces by their vertex indices (from 0)."""
    with atomic(path) as partial, partial.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"# dapple, metres, {axes} axes\no object1\n")
        np.savetxt(file, vertices, fmt="v %.5f %.5f %.5f")
        file.writelines(f"f {' '.join(map(str, corners + 1))}\n" for corners in polygons)


def read(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read vertices (n, 3), the corners of all faces one after another, and their numbers."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", _EXPECTED, "Check the path.")
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, start=1):  # noqa: B007
                if line.startswith("v "):
                    x, y, z = (float(word) for word in line.split()[1:4])
                    if not math.isfinite(x + y + z):
                        raise ValueError("no finite coordinates")
                    vertices.append([x, y, z])
                elif line.startswith("f "):
                    corners = [int(word.split("/")[0]) for word in line.split()[1:]]
                    faces.append([i - 1 if i > 0 else len(vertices) + i for i in corners])
    except ValueError as error:
        raise InputError(
            path,
            f"in line {number} `{line.strip()[:60]}`",
            _EXPECTED,
            "The file is damaged or truncated: copy or export it again.",
        ) from error
    if not faces:
        raise InputError(path, "no face", _EXPECTED, "Export the mesh with its faces.")
    return _checked(path, np.array(vertices).reshape(-1, 3), faces)


def _checked(
    path: Path, vertices: np.ndarray, faces: list[list[int]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Drop repeated closing corners and unused vertices; refuse faces that are no polygon."""
    count = np.array([len(face) for face in faces])
    numbers = [corner for face in faces for corner in face]
    low, high = min(numbers, default=0), max(numbers, default=0)  # may be too long for an int64
    if low < 0 or high >= len(vertices):
        worst = high if high >= len(vertices) else low
        raise InputError(
            path,
            f"a face with vertex {worst + 1}",
            f"vertices 1 to {len(vertices)}",
            "The file is damaged or truncated: copy or export it again.",
        )
    corners = np.array(numbers, np.int64)
    last = np.cumsum(count) - 1
    several = np.flatnonzero(count > 1)
    first = (last - count + 1)[several]
    closed = np.zeros(len(count), bool)
    closed[several] = (vertices[corners[first]] == vertices[corners[last[several]]]).all(axis=1)
    corners, count = np.delete(corners, last[closed]), count - closed
    if count.min() < 3:
        raise InputError(
            path,
            f"face {int(count.argmin()) + 1} with {count.min()} corners",
            "at least three different corners",
            "Remove degenerate faces and export the mesh again.",
        )
    used, corners = np.unique(corners, return_inverse=True)
    return vertices[used], corners, count
