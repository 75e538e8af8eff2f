"""Single leaves and polygons as triangles, and how they are turned."""

import numpy as np

from dapple.formats.meshes import Mesh
from dapple.structure.leaf_angles import normal_cosine_quantiles
from dapple.virtual.plant_skeleton import unit

# Outline of one half of an apple leaf: distance along the midrib (share of the length) and from
# it (share of the width), base and tip left out.
_HALF_OUTLINE = np.array([[0.20, 0.42], [0.48, 0.50], [0.78, 0.33]])
_HALF_FACES = np.array([[0, 2, 3], [0, 3, 4], [0, 4, 1]])  # base, tip, then the outline
_CLOSED = np.concatenate([[[0, 0]], _HALF_OUTLINE, [[1, 0]]])
BLADE_FORM = float(np.sum(np.diff(_CLOSED[:, 0]) * (_CLOSED[1:, 1] + _CLOSED[:-1, 1])))
"""Area of a blade per length and width."""


def draw_normals(n: int, distribution: str, rng: np.random.Generator) -> np.ndarray:
    """Draw unit normals of leaves.

    Parameters
    ----------
    n : int
        How many.
    distribution : str
        Leaf angle distribution, one of `dapple.structure.leaf_angles.DISTRIBUTIONS`.
    rng : numpy.random.Generator

    Returns
    -------
    (n, 3) float64
        Unit vectors of the upper half space; azimuths are uniform.

    Raises
    ------
    InputError
        The distribution is not known.
    """
    quantiles = normal_cosine_quantiles(distribution, 4097)
    cosine = np.interp(rng.uniform(size=n), np.linspace(0, 1, 4097), quantiles)
    azimuth = rng.uniform(0, 2 * np.pi, n)
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    return np.column_stack([sine * np.sin(azimuth), sine * np.cos(azimuth), cosine])


def blades(base_m, towards, normal, length_m, width_m, fold_deg: float) -> Mesh:
    """Leaves of six triangles, folded along the midrib.

    Parameters
    ----------
    base_m : (n, 3) float64
        Where the blade meets its petiole [m].
    towards : (n, 3) float64
        The midrib runs this way, as far as the normal allows.
    normal : (n, 3) float64
        Unit normals.
    length_m, width_m : (n,) float64
        Of the blade [m].
    fold_deg : float
        Angle by which either half is raised from the plane across the normal [°].

    Returns
    -------
    Mesh
        One element a leaf.
    """
    midrib = towards - (towards * normal).sum(1, keepdims=True) * normal
    # a petiole along the normal leaves the midrib's direction open: take any
    any_way = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.8, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    stuck = np.linalg.norm(midrib, axis=1, keepdims=True) < 1e-6
    midrib = unit(np.where(stuck, any_way, midrib))
    across, fold = np.cross(normal, midrib), np.radians(fold_deg)
    halves = []
    for sign in (1, -1):
        side = sign * np.cos(fold) * across + np.sin(fold) * normal
        halves.append(
            base_m[:, None]
            + _HALF_OUTLINE[:, :1] * (length_m[:, None] * midrib)[:, None]
            + _HALF_OUTLINE[:, 1:] * (width_m[:, None] * side)[:, None]
        )
    tip = base_m + length_m[:, None] * midrib
    vertices = np.concatenate([base_m[:, None], tip[:, None], *halves], axis=1)
    other_half = np.where(_HALF_FACES > 1, _HALF_FACES + 3, _HALF_FACES)
    return repeat_pattern(vertices, np.concatenate([_HALF_FACES[:, ::-1], other_half]))


def fans(centre_m, normal, area_m2, n_corners, elongation, rng: np.random.Generator) -> Mesh:
    """Flat convex polygons with their corners on an ellipse, all in one order of corners.

    Parameters
    ----------
    centre_m : (n, 3) float64
        Centre of gravity of each polygon [m].
    normal : (n, 3) float64
        Unit normals.
    area_m2 : (n,) float64
        Exact areas [m²].
    n_corners : (n,) int
        Corners of each polygon, at least 3.
    elongation : (n,) float64
        Short to long axis of the ellipse; exactly 1 makes the polygon regular.
    rng : numpy.random.Generator
        Turns the polygons in their plane and spreads their corners.

    Returns
    -------
    Mesh
        One element a polygon, fanned from its first corner.
    """
    n, widest = len(centre_m), int(n_corners.max())
    corner = np.arange(widest)
    used = corner < n_corners[:, None]
    jitter = rng.uniform(-0.35, 0.35, (n, widest)) * (elongation < 1)[:, None]
    angle = 2 * np.pi * (corner + jitter) / n_corners[:, None]
    # unused corners repeat the last one, so that they add no area
    angle = np.where(used, angle, np.take_along_axis(angle, n_corners[:, None] - 1, axis=1))
    flat = np.stack([np.cos(angle), elongation[:, None] * np.sin(angle)], axis=2)
    following = np.roll(flat, -1, axis=1)
    doubled = flat[..., 0] * following[..., 1] - flat[..., 1] * following[..., 0]
    centroid = ((flat + following) * doubled[..., None]).sum(1) / (3 * doubled.sum(1)[:, None])
    flat = (flat - centroid[:, None]) * np.sqrt(2 * area_m2 / doubled.sum(1))[:, None, None]

    first = unit(
        np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.8, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    )
    second, turn = np.cross(normal, first), rng.uniform(0, 2 * np.pi, (n, 1))
    first, second = (
        np.cos(turn) * first + np.sin(turn) * second,
        np.cos(turn) * second - np.sin(turn) * first,
    )
    vertices = centre_m[:, None] + flat[..., :1] * first[:, None] + flat[..., 1:] * second[:, None]
    start = np.cumsum(n_corners) - n_corners
    element = np.repeat(np.arange(n), n_corners - 2)
    k = np.arange(len(element)) - (np.cumsum(n_corners - 2) - (n_corners - 2))[element]
    faces = start[element][:, None] + np.column_stack([np.zeros_like(k), k + 1, k + 2])
    return Mesh(vertices[used], faces.astype(np.int32), element.astype(np.int32))


def repeat_pattern(vertices_m: np.ndarray, pattern: np.ndarray) -> Mesh:
    """Mesh of n equal elements from vertices (n, v, 3) and the triangles of one (t, 3)."""
    n, v = vertices_m.shape[:2]
    faces = pattern[None] + v * np.arange(n)[:, None, None]
    element = np.repeat(np.arange(n, dtype=np.int32), len(pattern))
    return Mesh(vertices_m.reshape(-1, 3), faces.reshape(-1, 3).astype(np.int32), element)


def pick(mesh: Mesh, chosen: np.ndarray) -> Mesh:
    """Elements `chosen` (ascending) of a mesh whose elements all have the same make-up."""
    vertices = mesh.vertices_m.reshape(mesh.n_elements, -1, 3)[chosen]
    pattern = mesh.faces[mesh.element == 0] - mesh.faces[mesh.element == 0].min()
    return repeat_pattern(vertices, pattern)
