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

    def contains(self, points_m: np.ndarray) -> np.ndarray:
        """(m,) bool: points (m, 3) inside the shape; the time is that of m times t tests."""
        return _inside(np.asarray(points_m, np.float64), self.corners_m)


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
    return AlphaShape(points_m, triangulation.simplices[kept])


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
        across = _across(corners_m[t])
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
                    if _holds(across, x, y, z):
                        grid[i, j, k] = label[t]


@njit(cache=True)
def _across(corners_m):
    """Vectors whose products with a place (from corner 0) are its barycentric coordinates."""
    a = corners_m[0]
    u, v, w = corners_m[1] - a, corners_m[2] - a, corners_m[3] - a
    across = np.empty((3, 3))
    across[0], across[1], across[2] = np.cross(v, w), np.cross(w, u), np.cross(u, v)
    six_volumes = u[0] * across[0, 0] + u[1] * across[0, 1] + u[2] * across[0, 2]
    # A flat one holds nothing: coordinates that are no numbers pass no test.
    return across / six_volumes if six_volumes != 0.0 else across * np.nan


@njit(cache=True)
def _holds(across, x, y, z):
    p = x * across[0, 0] + y * across[0, 1] + z * across[0, 2]
    q = x * across[1, 0] + y * across[1, 1] + z * across[1, 2]
    r = x * across[2, 0] + y * across[2, 1] + z * across[2, 2]
    return p >= 0.0 and q >= 0.0 and r >= 0.0 and p + q + r <= 1.0


@njit(cache=True)
def _inside(points_m, corners_m):
    found = np.zeros(len(points_m), np.bool_)
    for t in range(len(corners_m)):
        across, a = _across(corners_m[t]), corners_m[t, 0]
        for i in range(len(points_m)):
            p = points_m[i]
            if not found[i] and _holds(across, p[0] - a[0], p[1] - a[1], p[2] - a[2]):
                found[i] = True
    return found
