"""Random square facets that stand for the plant area of a volume, and the terrain under them."""

import numpy as np

from dapple.formats.meshes import Mesh


def numbers(plant_area_m2: np.ndarray, facet_area_m2: float) -> np.ndarray:
    """How many facets each part gets: whole numbers whose running sum stays within half a facet.

    Parameters
    ----------
    plant_area_m2 : (p,) float64
        One-sided plant area of each part [m²].
    facet_area_m2 : float

    Returns
    -------
    (p,) int64
    """
    sums = np.rint(np.cumsum(plant_area_m2) / facet_area_m2).astype(np.int64)
    return np.diff(sums, prepend=0)


def squares(centre_m: np.ndarray, *, facet_area_m2: float, rng: np.random.Generator) -> Mesh:
    """Squares with random normals, spherical: as the surface of a sphere, G = 0.5 everywhere.

    They are one merged mesh, not instances: an instance costs more memory (a 3 x 4 matrix and a
    node of its own in the tree of boxes) than the two triangles of a facet, and time when traced.

    Parameters
    ----------
    centre_m : (n, 3) float64
        Local frame [m].
    facet_area_m2 : float
        One-sided area; edges are its root [m²].
    rng : Generator

    Returns
    -------
    Mesh
        Two triangles and one element a facet, in the order of the centres.
    """
    n = len(centre_m)
    normal, spin = _unit(rng, n), rng.random(n) * 2 * np.pi
    across = np.cross(normal, np.where(np.abs(normal[:, 2:]) < 0.9, [[0, 0, 1]], [[1, 0, 0]]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normal, across)
    half = np.sqrt(facet_area_m2 / 2)  # from the centre to a corner
    u = half * (np.cos(spin)[:, None] * across + np.sin(spin)[:, None] * along)
    v = np.cross(normal, u)
    corners = np.stack([centre_m + u, centre_m + v, centre_m - u, centre_m - v], axis=1)
    fan = np.array([[0, 1, 2], [0, 2, 3]])
    faces = (4 * np.arange(n))[:, None, None] + fan
    return Mesh(
        corners.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n, dtype=np.int32), 2),
    )


def _unit(rng: np.random.Generator, n: int) -> np.ndarray:
    z, azimuth = rng.uniform(-1, 1, n), rng.random(n) * 2 * np.pi
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(azimuth), r * np.sin(azimuth), z], axis=1)


def terrain(
    ground_m: np.ndarray, *, left_m: float, top_m: float, pixel_m: float, step_m: float
) -> Mesh:
    """The ground as triangles that cover every pixel of an elevation model.

    Parameters
    ----------
    ground_m : (rows, columns) float
        Elevation at the centres of pixels, row 0 in the north, local frame [m].
    left_m, top_m : float
        Outer north-west corner, local frame [m].
    pixel_m : float
        Edge of a pixel [m].
    step_m : float
        Wanted edge of the terrain's squares [m]; between them the ground is bilinear.

    Returns
    -------
    Mesh
        Two triangles and one element a square; normals point up.
    """
    rows, columns = ground_m.shape
    n_y, n_x = (max(1, round(n * pixel_m / step_m)) for n in (rows, columns))
    y = np.linspace(0, rows * pixel_m, n_y + 1)
    x = np.linspace(0, columns * pixel_m, n_x + 1)
    z = _at_nodes(ground_m, y / pixel_m - 0.5, x / pixel_m - 0.5)
    xx, yy = np.meshgrid(left_m + x, top_m - y)
    vertices = np.stack([xx, yy, z], axis=-1).reshape(-1, 3)
    at = np.arange(len(vertices)).reshape(n_y + 1, n_x + 1)
    north_west, north_east = at[:-1, :-1].ravel(), at[:-1, 1:].ravel()
    south_west, south_east = at[1:, :-1].ravel(), at[1:, 1:].ravel()
    faces = np.stack(
        [south_west, south_east, north_east, south_west, north_east, north_west], axis=1
    )
    return Mesh(
        vertices,
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n_x * n_y, dtype=np.int32), 2),
    )


def _at_nodes(values: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Bilinear interpolation at every row and column, straight on beyond the outermost pixels."""

    def weights(at: np.ndarray, n: int) -> np.ndarray:
        if n == 1:
            return np.ones((len(at), 1))
        low = np.clip(np.floor(at).astype(int), 0, n - 2)
        matrix = np.zeros((len(at), n))
        matrix[np.arange(len(at)), low] = 1 - (at - low)
        matrix[np.arange(len(at)), low + 1] = at - low
        return matrix

    return weights(row, values.shape[0]) @ values @ weights(column, values.shape[1]).T
