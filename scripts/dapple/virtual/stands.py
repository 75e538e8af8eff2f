"""Stands of virtual trees: a few trees grown, many placed, and what every voxel truly holds."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from dapple.formats.meshes import Mesh
from dapple.streams import stream_seed
from dapple.virtual.box_grids import grid_shape
from dapple.virtual.plants import Plant, apple_tree
from dapple.virtual.stand_species import of_stand


@dataclass(frozen=True)
class Stand:
    """Trees in a box that stands on the ground, one corner at the origin.

    Attributes
    ----------
    size_m : (3,) float64
        Edges of the box along x, y, z [m].
    plants : tuple of Plant
        The trees that were grown, each on the origin.
    grown : (n,) int64
        Which of `plants` each tree of the stand is.
    base_m : (n, 3) float64
        Where each tree stands [m].
    turn_rad : (n,) float64
        By how much it is turned about its stem, anticlockwise from above [rad].
    """

    size_m: np.ndarray
    plants: tuple[Plant, ...]
    grown: np.ndarray
    base_m: np.ndarray
    turn_rad: np.ndarray

    @property
    def leaf_area_index(self) -> float:
        """Leaf area of all trees over the ground of the box."""
        leaf_m2 = sum(self.plants[k].leaves.area_m2 for k in self.grown)
        return float(leaf_m2 / (self.size_m[0] * self.size_m[1]))

    def placement(self, tree: int) -> np.ndarray:
        """(4, 4) matrix from the frame of the plant to that of the stand."""
        cosine, sine = np.cos(self.turn_rad[tree]), np.sin(self.turn_rad[tree])
        matrix = np.eye(4)
        matrix[:2, :2] = [[cosine, -sine], [sine, cosine]]
        matrix[:3, 3] = self.base_m[tree]
        return matrix

    def triangles(self, part: str) -> Iterator[np.ndarray]:
        """Corners (t, 3, 3) of the `leaves` or the `wood`, one tree after another [m]."""
        for tree, grown in enumerate(self.grown):
            mesh: Mesh = getattr(self.plants[grown], part)
            matrix = self.placement(tree)
            placed = mesh.vertices_m @ matrix[:3, :3].T + matrix[:3, 3]
            yield placed[mesh.faces]


def grow(
    species: str,
    positions_m: np.ndarray,
    *,
    size_m: tuple[float, float, float] = (15.0, 15.0, 30.0),
    leaf_area_index: float = 4.5,
    n_grown: int = 2,
    seed: int,
    **changes,
) -> Stand:
    """Grow a stand.

    Parameters
    ----------
    species : str
        A key of `SPECIES`.
    positions_m : (n, 2) float64
        Where trees stand [m].
    size_m : three floats
        Edges of the box [m].
    leaf_area_index : float
        One-sided leaf area over ground area, met to within a leaf per tree.
    n_grown : int
        So many different trees are grown and then placed in turn, each turned by chance.
    seed : int
        Same seed, same stand.
    **changes
        Parameters of `plants.apple_tree` that differ from the species'.

    Raises
    ------
    InputError
        An unknown species, no tree, or a tree outside the box.
    """
    positions_m = np.asarray(positions_m, np.float64).reshape(-1, 2)
    settings = of_stand(species, positions_m.tolist(), size_m, leaf_area_index, **changes)
    n, size = len(positions_m), np.asarray(size_m, np.float64)
    leaf_area_m2 = leaf_area_index * size[0] * size[1] / n
    plants = tuple(
        apple_tree(
            **settings, leaf_area_m2=leaf_area_m2, seed=stream_seed(seed, "stand", species, k)
        )
        for k in range(min(n_grown, n))
    )
    rng = np.random.default_rng(stream_seed(seed, "stand", species, "places"))
    return Stand(
        size,
        plants,
        np.arange(n) % len(plants),
        np.column_stack([positions_m, np.zeros(n)]),
        rng.uniform(0, 2 * np.pi, n),
    )


def area_in_voxels(stand: Stand, part: str, voxel_size_m: float) -> np.ndarray:
    """Exact one-sided area of leaves or wood in every voxel of the box.

    Parameters
    ----------
    part : str
        `leaves` or `wood`.
    voxel_size_m : float
        Edge of the voxels; has to divide the box [m].

    Returns
    -------
    (nx, ny, nz) float64
        [m²]; what grows out of the box is left out.
    """
    shape = grid_shape(stand.size_m.tolist(), voxel_size_m)
    area = np.zeros(shape)
    for corners in stand.triangles(part):
        _add_area(np.ascontiguousarray(corners), voxel_size_m, area)
    return area


@njit(cache=True)
def _cut(polygon, n, axis, at, above, out):
    """Part of a convex polygon on one side of a plane across an axis; returns its corners."""
    m = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        a, b = polygon[i, axis] - at, polygon[j, axis] - at
        if not above:
            a, b = -a, -b
        if a >= 0.0:
            out[m] = polygon[i]
            m += 1
        if (a > 0.0 and b < 0.0) or (a < 0.0 and b > 0.0):
            share = a / (a - b)
            for k in range(3):
                out[m, k] = polygon[i, k] + share * (polygon[j, k] - polygon[i, k])
            m += 1
    return m


@njit(cache=True)
def _slab(polygon, n, axis, index, size, spare, out):
    """Part of a convex polygon inside one slab of voxels."""
    return _cut(spare, _cut(polygon, n, axis, index * size, True, spare), axis,
                (index + 1) * size, False, out)  # fmt: skip


@njit(cache=True)
def _area(polygon, n):
    x = y = z = 0.0
    for i in range(1, n - 1):
        u, v = polygon[i] - polygon[0], polygon[i + 1] - polygon[0]
        x += u[1] * v[2] - u[2] * v[1]
        y += u[2] * v[0] - u[0] * v[2]
        z += u[0] * v[1] - u[1] * v[0]
    return 0.5 * np.sqrt(x * x + y * y + z * z)


@njit(cache=True)
def _add_area(corners, size, area):
    """Add the area of triangles to the voxels that they lie in."""
    spare, by_x = np.empty((12, 3)), np.empty((12, 3))
    by_y, by_z = np.empty((12, 3)), np.empty((12, 3))
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for t in range(len(corners)):
        for k in range(3):
            c = corners[t, :, k]
            low[k] = max(int(np.floor(c.min() / size)), 0)
            high[k] = min(int(np.floor(c.max() / size)), area.shape[k] - 1)
        if (low == high).all():
            inside = corners[t].min() >= 0.0
            for k in range(3):
                inside &= corners[t, :, k].max() <= area.shape[k] * size
            if inside:
                area[low[0], low[1], low[2]] += _area(corners[t], 3)
                continue
        for i in range(low[0], high[0] + 1):
            n_x = _slab(corners[t], 3, 0, i, size, spare, by_x)
            for j in range(low[1], high[1] + 1):
                n_y = _slab(by_x, n_x, 1, j, size, spare, by_y)
                for k in range(low[2], high[2] + 1):
                    n_z = _slab(by_y, n_y, 2, k, size, spare, by_z)
                    if n_z > 2:
                        area[i, j, k] += _area(by_z, n_z)
