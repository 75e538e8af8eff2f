"""Scenes of the RAdiation transfer Model Intercomparison (RAMI): leaves given as discs.

A file of discs has one line a disc, `radius x y z nx ny nz` in metres; a file of instances has one
line a place, `x y z`, where the object of the first file stands.
"""

import warnings
from pathlib import Path

import numpy as np

from dapple.errors import InputError


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


def _table(path: str | Path, n_columns: int, names: str) -> np.ndarray:
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", f"lines `{names}`", "Check the path.")
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "loadtxt: input contained no data")
            table = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise InputError(path, str(error), f"lines `{names}`", "Copy the file again.") from error
    if not table.size:
        raise InputError(path, "no line", f"lines `{names}`", "Copy the file again.")
    if not np.isfinite(table).all():
        line = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1
        raise InputError(
            path, f"line {line} with no finite number", f"lines `{names}`", "Correct the line."
        )
    if table.shape[1] != n_columns:
        raise InputError(
            path,
            f"{table.shape[1]} columns",
            f"{n_columns}: {names}",
            "Give the file of discs and that of instances in the right places.",
        )
    return table
