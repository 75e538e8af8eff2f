"""Scenes of the RAdiation transfer Model Intercomparison (RAMI): leaves given as discs.

A file of discs has one line a disc, `radius x y z nx ny nz` in metres; a file of instances has one
line a place, `x y z`, where the object of the first file stands.
"""

from pathlib import Path

import numpy as np

from dapple.errors import InputError
from dapple.formats.meshes import Mesh


def read_discs(path: str | Path) -> np.ndarray:
    """Read discs.

    Returns
    -------
    (n, 7) float64
        Radius, centre, unit normal [m].

    Raises
    ------
    InputError
        No such file, other columns, or a radius or normal that is nought.
    """
    discs = _table(path, 7, "radius x y z nx ny nz")
    length = np.linalg.norm(discs[:, 4:], axis=1)
    if (discs[:, 0] <= 0).any() or (length == 0).any():
        line = int(np.flatnonzero((discs[:, 0] <= 0) | (length == 0))[0]) + 1
        raise InputError(
            path,
            f"line {line} with a radius or a normal of no length",
            "discs with a size and a direction",
            "Copy the file again.",
        )
    discs[:, 4:] /= length[:, None]
    return discs


def read_places(path: str | Path) -> np.ndarray:
    """Read the places where an object stands.

    Returns
    -------
    (n, 3) float64
        Shifts from where the object is described [m].

    Raises
    ------
    InputError
        No such file, or other columns.
    """
    return _table(path, 3, "x y z")


def disc_mesh(discs: np.ndarray, n_sides: int = 12) -> Mesh:
    """Discs as regular polygons of the same area, one element each.

    Parameters
    ----------
    discs : (n, 7) float64
        Radius, centre, unit normal [m].
    n_sides : int
        Corners of a polygon, at least 3.
    """
    n = len(discs)
    normal = discs[:, 4:]
    helper = np.eye(3)[np.abs(normal).argmin(axis=1)]
    across = np.cross(normal, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normal, across)
    turn = 2 * np.pi / n_sides
    reach = discs[:, 0] * np.sqrt(2 * np.pi / (n_sides * np.sin(turn)))
    angle = np.arange(n_sides) * turn
    rim = across[:, None] * np.cos(angle)[:, None] + along[:, None] * np.sin(angle)[:, None]
    vertices = discs[:, None, 1:4] + reach[:, None, None] * rim
    step = np.arange(1, n_sides - 1)
    fan = np.stack([np.zeros_like(step), step, step + 1], axis=1)
    faces = np.arange(n)[:, None, None] * n_sides + fan
    return Mesh(
        vertices.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n, dtype=np.int32), n_sides - 2),
    )


def _table(path: str | Path, n_columns: int, names: str) -> np.ndarray:
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", f"lines `{names}`", "Check the path.")
    try:
        table = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise InputError(path, str(error), f"lines `{names}`", "Copy the file again.") from error
    if table.shape[1] != n_columns:
        raise InputError(
            path,
            f"{table.shape[1]} columns",
            f"{n_columns}: {names}",
            "Give the file of discs and that of instances in the right places.",
        )
    return table
