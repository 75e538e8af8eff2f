"""Three-dimensional alpha shapes: what a cloud of points encloses."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from scipy.spatial import Delaunay, QhullError

from dapple.errors import InputError


@dataclass(frozen=True)
class AlphaShape:
    """The tetrahedra of a Delaunay triangulation whose circumspheres are small.

    Attributes
    ----------
    points_m : (n, 3) float64
        Local frame [m].
    tetrahedra : (t, 4) int
        Indices of the corners of those that are kept.
    """

    points_m: np.ndarray
    tetrahedra: np.ndarray
    _all: Delaunay | None = None
    _kept: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.tetrahedra)

    @cached_property
    def corners_m(self) -> np.ndarray:
        """(t, 4, 3) corners of the tetrahedra [m]."""
        return self.points_m[self.tetrahedra]

    @cached_property
    def volumes_m3(self) -> np.ndarray:
        """(t,) volumes of the tetrahedra [m³]."""
        a, b, c = (self.corners_m[:, k] - self.corners_m[:, 0] for k in (1, 2, 3))
        return np.abs(np.einsum("ij,ij->i", a, np.cross(b, c))) / 6

    @property
    def volume_m3(self) -> float:
        return float(self.volumes_m3.sum())

    def find(self, points_m: np.ndarray) -> np.ndarray:
        """(m,) index of the tetrahedron around each point (m, 3), -1 outside the shape."""
        if self._all is None or not len(self):
            return np.full(len(points_m), -1)
        number = np.full(len(self._kept) + 1, -1)
        number[:-1][self._kept] = np.arange(len(self))
        return number[self._all.find_simplex(points_m)]

    def contains(self, points_m: np.ndarray) -> np.ndarray:
        """(m,) bool: points inside the shape."""
        return self.find(points_m) >= 0


def build(points_m: np.ndarray, alpha_m: float) -> AlphaShape:
    """The alpha shape of points.

    Parameters
    ----------
    points_m : (n, 3) float64
        Local frame [m].
    alpha_m : float
        Tetrahedra whose circumsphere has a larger radius are left out: hollows wider than about
        twice this stay open [m].

    Returns
    -------
    AlphaShape
        Without tetrahedra where the points span no volume (fewer than four, or all in a plane).

    Raises
    ------
    InputError
        `alpha_m` is not positive.

    Notes
    -----
    Edelsbrunner and Mücke (1994), ACM Transactions on Graphics 13, 43-72; only the solid part of
    their complex is kept, no single faces or edges.
    """
    if not alpha_m > 0:
        raise InputError("alpha_m", f"{alpha_m}", "a positive radius", "Raise it.")
    empty = np.zeros((0, 4), np.int64)
    if len(points_m) < 4:
        return AlphaShape(points_m, empty)
    try:
        triangulation = Delaunay(points_m)
    except QhullError:
        return AlphaShape(points_m, empty)
    kept = circumradius_m(points_m[triangulation.simplices]) <= alpha_m
    return AlphaShape(points_m, triangulation.simplices[kept], triangulation, kept)


def circumradius_m(corners_m: np.ndarray) -> np.ndarray:
    """(t,) radii of the spheres through the corners (t, 4, 3) of tetrahedra; inf if flat [m]."""
    a, b, c = (corners_m[:, k] - corners_m[:, 0] for k in (1, 2, 3))
    normal = np.cross(b, c)
    six_volumes = np.einsum("ij,ij->i", a, normal)
    aa, bb, cc = (np.einsum("ij,ij->i", v, v)[:, None] for v in (a, b, c))
    centre = np.linalg.norm(aa * normal + bb * np.cross(c, a) + cc * np.cross(a, b), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = centre / (2 * np.abs(six_volumes))
    return np.where(np.isfinite(radius), radius, np.inf)


def sample(
    corners_m: np.ndarray, volumes_m3: np.ndarray, n: int, rng: np.random.Generator
) -> np.ndarray:
    """Random points, uniform over the volume of tetrahedra.

    Parameters
    ----------
    corners_m : (t, 4, 3) float64
        As `AlphaShape.corners_m`, all or some of them [m].
    volumes_m3 : (t,) float64
        Their volumes [m³].
    n : int
        Number of points.
    rng : Generator

    Returns
    -------
    (n, 3) float64

    Raises
    ------
    InputError
        Points are asked of no volume.

    Notes
    -----
    Gaps between sorted uniform numbers are uniform barycentric coordinates.
    """
    total = np.cumsum(volumes_m3)
    if n == 0:
        return np.zeros((0, 3))
    if not len(total) or total[-1] <= 0:
        raise InputError("alpha shape", "no volume", "points that span one", "Raise alpha_m.")
    chosen = np.searchsorted(total, rng.random(n) * total[-1], side="right")
    chosen = np.minimum(chosen, len(total) - 1)
    cuts = np.sort(rng.random((n, 3)), axis=1)
    weights = np.diff(cuts, axis=1, prepend=0.0, append=1.0)
    return np.einsum("ij,ijk->ik", weights, corners_m[chosen])


@njit(cache=True)
def draw(corners_m, label, grid, corner_m, size_m):
    """Write labels into the voxels whose centres lie in tetrahedra.

    Parameters
    ----------
    corners_m : (t, 4, 3) float64
        Local frame [m].
    label : (t,) int
        What to write for each tetrahedron.
    grid : (nx, ny, nz) int32
        Voxels, changed in place; centres outside of all tetrahedra keep their value.
    corner_m : (3,) float64
        Lowest corner of the grid [m].
    size_m : float
        Edge of a voxel [m].
    """
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for t in range(len(corners_m)):
        a = corners_m[t, 0]
        u, v, w = corners_m[t, 1] - a, corners_m[t, 2] - a, corners_m[t, 3] - a
        vw, wu, uv = np.cross(v, w), np.cross(w, u), np.cross(u, v)
        six_volumes = u[0] * vw[0] + u[1] * vw[1] + u[2] * vw[2]
        if six_volumes == 0.0:
            continue
        for k in range(3):
            least, most = corners_m[t, :, k].min(), corners_m[t, :, k].max()
            low[k] = max(0, int(np.floor((least - corner_m[k]) / size_m - 0.5)))
            high[k] = min(grid.shape[k], int(np.ceil((most - corner_m[k]) / size_m + 0.5)))
        for i in range(low[0], high[0]):
            x = corner_m[0] + (i + 0.5) * size_m - a[0]
            for j in range(low[1], high[1]):
                y = corner_m[1] + (j + 0.5) * size_m - a[1]
                for k in range(low[2], high[2]):
                    z = corner_m[2] + (k + 0.5) * size_m - a[2]
                    p = (x * vw[0] + y * vw[1] + z * vw[2]) / six_volumes
                    q = (x * wu[0] + y * wu[1] + z * wu[2]) / six_volumes
                    r = (x * uv[0] + y * uv[1] + z * uv[2]) / six_volumes
                    if p >= 0.0 and q >= 0.0 and r >= 0.0 and p + q + r <= 1.0:
                        grid[i, j, k] = label[t]
