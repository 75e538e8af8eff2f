"""Triangle meshes in the local frame, each triangle knowing which leaf or polygon it is part of."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


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
        a, b, c = (self.vertices_m[self.faces[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    @property
    def triangle_area_m2(self) -> np.ndarray:
        """(t,) one-sided areas [m²]."""
        return 0.5 * np.linalg.norm(self.triangle_normal, axis=1)

    @property
    def element_area_m2(self) -> np.ndarray:
        """(n_elements,) one-sided areas [m²]."""
        return np.bincount(self.element, self.triangle_area_m2, self.n_elements)

    @property
    def area_m2(self) -> float:
        """Total one-sided area [m²]."""
        return float(self.triangle_area_m2.sum())


def concatenate(meshes: list[Mesh]) -> Mesh:
    """Put meshes together; elements keep their order and are renumbered."""
    vertex_shift = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes])
    element_shift = np.cumsum([0] + [mesh.n_elements for mesh in meshes])
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]).reshape(-1, 3),
        np.concatenate([m.faces + s for m, s in zip(meshes, vertex_shift[:-1], strict=True)])
        .reshape(-1, 3)
        .astype(np.int32),
        np.concatenate(
            [m.element + s for m, s in zip(meshes, element_shift[:-1], strict=True)]
        ).astype(np.int32),
    )
