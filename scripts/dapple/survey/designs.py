"""Where scanners stand."""

import numpy as np

from dapple.errors import InputError

_CENTRE = ((0.5, 0.5),)
_SHARES = {
    "single": _CENTRE,
    "diamond": (*_CENTRE, (0.5, 0.0), (1.0, 0.5), (0.5, 1.0), (0.0, 0.5)),
    "corners": (*_CENTRE, (0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)),
}


def positions(
    design: str,
    size_m: tuple[float, float, float],
    height_m: float,
    own_m: tuple[tuple[float, float], ...] = (),
) -> np.ndarray:
    """Scan positions of a design.

    Parameters
    ----------
    design : str
        `single` (the centre), `diamond` (the centre and the middle of each side), `corners` (the
        centre and the corners), or `list`: the positions `own_m`.
    size_m : three floats
        Edges of the volume [m].
    height_m : float
        Height of the scanner above the ground [m].
    own_m : tuple of pairs
        Places of the design `list` [m].

    Returns
    -------
    (n, 3) float64
        Frame of the stand [m].

    Raises
    ------
    InputError
        An unknown design or an empty list.
    """
    if design == "list":
        places = np.array(own_m, np.float64).reshape(-1, 2)
    elif design in _SHARES:
        places = np.array(_SHARES[design]) * np.asarray(size_m)[:2]
    else:
        raise InputError(
            "survey.designs", design, ", ".join([*_SHARES, "list"]), "Choose among these."
        )
    if not len(places):
        raise InputError(
            "survey.positions_m",
            "no position",
            "at least one, for the design `list`",
            "Give pairs of x and y in metres.",
        )
    return np.column_stack([places, np.full(len(places), height_m)])


def candidates(size_m: tuple[float, float, float], height_m: float, along: int) -> np.ndarray:
    """A square grid of `along` x `along` places from edge to edge, (n, 3) [m]."""
    x, y = (np.linspace(0, edge, along) for edge in size_m[:2])
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.column_stack([places, np.full(len(places), height_m)])
