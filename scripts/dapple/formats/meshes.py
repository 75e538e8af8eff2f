"""Triangle meshes in the local frame, each triangle knowing which leaf or polygon it is part of."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from dapple.formats import obj, ply

PIECE = 1_000_000
"""Triangles that are looked at together."""


@dataclass(frozen=True)
class Mesh:
    """Triangles grouped into elements (a leaf, a polygon, a branch segment).

    Attributes
    ----------
    vertices_m : (v, 3) float64
        Local frame: east, north, up [m].
    faces : (t, 3) int32
        Vertex indices.
    element : (t,) int32
        The element that each triangle belongs to, 0 to n_elements - 1, in ascending order.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    element: np.ndarray

    @property
    def n_elements(self) -> int:
        return int(self.element[-1]) + 1 if len(self.element) else 0

    @cached_property
    def triangle_normal(self) -> np.ndarray:
        """(t, 3) normals whose length is twice the triangle's area [m²]."""
        normal = np.empty((len(self.faces), 3))
        for at in range(0, len(self.faces), PIECE):
            normal[at : at + PIECE] = self._normals(at)
        return normal

    def _normals(self, at: int) -> np.ndarray:
        """`triangle_normal` of a piece."""
        faces = self.faces[at : at + PIECE]
        a, b, c = (self.vertices_m[faces[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    @property
    def triangle_area_m2(self) -> np.ndarray:
        """(t,) one-sided areas [m²]."""
        area_m2 = np.empty(len(self.faces))
        for at in range(0, len(self.faces), PIECE):
            area_m2[at : at + PIECE] = 0.5 * np.linalg.norm(self._normals(at), axis=1)
        return area_m2

    @property
    def element_area_m2(self) -> np.ndarray:
        """(n_elements,) one-sided areas [m²]."""
        return np.bincount(self.element, self.triangle_area_m2, self.n_elements)

    @property
    def element_centre_m(self) -> np.ndarray:
        """(n_elements, 3) centres of gravity: the mean of the triangles' weighted by area [m]."""
        middle_m, area_m2 = self.vertices_m[self.faces].mean(axis=1), self.triangle_area_m2
        moment = [
            np.bincount(self.element, area_m2 * middle_m[:, k], self.n_elements) for k in range(3)
        ]
        return np.stack(moment, axis=1) / self.element_area_m2[:, None]

    @property
    def element_normal(self) -> np.ndarray:
        """(n_elements, 3) unit normals, the mean of the triangles' weighted by area."""
        axes = [
            np.bincount(self.element, self.triangle_normal[:, k], self.n_elements) for k in range(3)
        ]
        normal = np.stack(axes, axis=1)
        return normal / np.linalg.norm(normal, axis=1, keepdims=True)

    @property
    def tilt_deg(self) -> np.ndarray:
        """(n_elements,) angle between each element and the horizontal, 0 to 90 [°]."""
        return np.degrees(np.arccos(np.clip(np.abs(self.element_normal[:, 2]), 0, 1)))

    @property
    def area_m2(self) -> float:
        """Total one-sided area [m²]."""
        return float(self.triangle_area_m2.sum())


def empty() -> Mesh:
    """A mesh without any element."""
    return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))


def of_discs(discs: np.ndarray, n_sides: int = 12) -> Mesh:
    """Discs as regular polygons of the same area, one element each.

    Parameters
    ----------
    discs : (n, 7) float64
        Radius, centre, unit normal [m].
    n_sides : int
        Corners of a polygon, at least 3.
    """
    n = len(discs)
    vertices_m = np.empty((n, n_sides, 3))
    for start in range(0, n, PIECE):
        vertices_m[start : start + PIECE] = _rims(discs[start : start + PIECE], n_sides)
    step = np.arange(1, n_sides - 1, dtype=np.int32)
    fan = np.stack([np.zeros_like(step), step, step + 1], axis=1)
    faces = np.arange(n, dtype=np.int32)[:, None, None] * np.int32(n_sides) + fan
    return Mesh(
        vertices_m.reshape(-1, 3),
        faces.reshape(-1, 3),
        np.repeat(np.arange(n, dtype=np.int32), n_sides - 2),
    )


def _rims(discs: np.ndarray, n_sides: int) -> np.ndarray:
    """(n, sides, 3) corners of regular polygons as large as discs [m]."""
    normal = discs[:, 4:]
    helper = np.eye(3)[np.abs(normal).argmin(axis=1)]
    across = np.cross(normal, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normal, across)
    turn = 2 * np.pi / n_sides
    reach = discs[:, 0] * np.sqrt(2 * np.pi / (n_sides * np.sin(turn)))
    angle = np.arange(n_sides) * turn
    rim = across[:, None] * np.cos(angle)[:, None] + along[:, None] * np.sin(angle)[:, None]
    return discs[:, None, 1:4] + reach[:, None, None] * rim


def concatenate(meshes: list[Mesh]) -> Mesh:
    """Put meshes together; elements keep their order and are renumbered.

    The list is emptied on the way: of large meshes, memory holds none twice.
    """
    vertices_m = np.empty((sum(len(mesh.vertices_m) for mesh in meshes), 3))
    faces = np.empty((sum(len(mesh.faces) for mesh in meshes), 3), np.int32)
    element = np.empty(len(faces), np.int32)
    n_vertices = n_faces = n_elements = 0
    while meshes:
        mesh = meshes.pop(0)
        rows = slice(n_faces, n_faces + len(mesh.faces))
        vertices_m[n_vertices : n_vertices + len(mesh.vertices_m)] = mesh.vertices_m
        np.add(mesh.faces, n_vertices, out=faces[rows], casting="same_kind")
        np.add(mesh.element, n_elements, out=element[rows], casting="same_kind")
        n_vertices += len(mesh.vertices_m)
        n_faces += len(mesh.faces)
        n_elements += mesh.n_elements
    return Mesh(vertices_m, faces, element)


def write_ply(
    path: str | Path, mesh: Mesh, origin_m: tuple[float, ...] | np.ndarray = (0.0, 0.0, 0.0)
) -> None:
    """Write binary little-endian PLY; nothing is lost.

    Vertices are float64 in the local frame, faces are triangles with an int32 property `element`,
    a comment names `origin_m`, the world coordinates of the local origin [m].
    """
    ply.write(path, mesh.vertices_m, mesh.faces, mesh.element, np.asarray(origin_m, np.float64))


def read_ply(path: str | Path) -> Mesh:
    """Read binary little-endian PLY of triangles.

    Files without the face property `element` are read with one element a triangle.

    Raises
    ------
    InputError
        The file is missing, truncated, of another kind, or its faces name vertices that are not
        there.
    """
    return Mesh(*ply.read(path)[:3])


def write_obj(path: str | Path, mesh: Mesh, axes: str) -> None:
    """Write Wavefront OBJ for other programs, one face an element where it is one flat polygon.

    Parameters
    ----------
    path : Path
    mesh : Mesh
        Elements that are not a flat fan of triangles are written triangle by triangle.
    axes : str
        `less`, `dart` (as these programs expect them, see `dapple.frames`) or `local`.
    """
    vertices = obj.to_axes(mesh.vertices_m, axes)
    obj.write(path, vertices, polygons_of(mesh), axes)


def without_backs(mesh: Mesh) -> Mesh:
    """Each element once, where it comes a second time, turned round to be seen from behind."""
    starts = np.flatnonzero(np.diff(mesh.element, prepend=-1))
    first: dict[tuple[int, ...], int] = {}
    for number, faces in enumerate(np.split(mesh.faces, starts[1:])):
        first.setdefault(tuple(np.unique(faces)), number)
    kept = np.isin(mesh.element, list(first.values()))
    _, element = np.unique(mesh.element[kept], return_inverse=True)
    return Mesh(mesh.vertices_m, mesh.faces[kept], element.astype(np.int32))


def read_obj(path: str | Path, axes: str) -> Mesh:
    """Read Wavefront OBJ; each face becomes an element, cut into triangles from its first vertex.

    Faces may repeat their first vertex at the end (the same index or the same place). Texture and
    normal indices, groups and materials are ignored.

    Parameters
    ----------
    path : Path
    axes : str
        The axes of the file: `less`, `dart` or `local`.

    Raises
    ------
    InputError
        The file is missing, holds no face, a line cannot be read, a face names a vertex that is
        not there, or has fewer than three corners.
    """
    vertices, corners, count = obj.read(path)
    first = np.repeat(np.cumsum(count) - count, count - 2)
    element = np.repeat(np.arange(len(count)), count - 2)
    step = np.arange(len(element)) - np.repeat(np.cumsum(count - 2) - (count - 2), count - 2)
    faces = np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)
    return Mesh(obj.from_axes(vertices, axes), faces.astype(np.int32), element.astype(np.int32))


def polygons_of(mesh: Mesh) -> list[np.ndarray]:
    """Vertex indices of each element's outline, or of its triangles where it is no flat fan."""
    faces, element = mesh.faces, mesh.element
    if not len(faces):
        return []
    same = element[1:] == element[:-1]
    normal = mesh.triangle_normal
    length = np.linalg.norm(normal, axis=1)
    flat = (normal[1:] * normal[:-1]).sum(axis=1) >= (1 - 1e-9) * length[1:] * length[:-1]
    fan = (faces[1:, 0] == faces[:-1, 0]) & (faces[1:, 1] == faces[:-1, 2]) & flat
    broken = np.zeros(mesh.n_elements, bool)
    broken[element[1:][same & ~fan]] = True
    begin = np.flatnonzero(np.concatenate([[True], ~same | broken[element[1:]]]))
    ends = np.concatenate([begin[1:], [len(faces)]])
    return [np.concatenate([faces[a, :2], faces[a:b, 2]]) for a, b in zip(begin, ends, strict=True)]
