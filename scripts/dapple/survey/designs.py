"""Where scanners stand."""

from collections.abc import Sequence

from dapple.errors import InputError

Position = tuple[float, float, float]
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
) -> list[Position]:
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
    list of three floats
        East, north and height in the frame of the stand [m].

    Raises
    ------
    InputError
        An unknown design or an empty list.
    """
    if design == "list":
        places = [(float(x), float(y)) for x, y in own_m]
    elif design in _SHARES:
        places = [(x * size_m[0], y * size_m[1]) for x, y in _SHARES[design]]
    else:
        raise InputError(
            "survey.designs", design, ", ".join([*_SHARES, "list"]), "Choose among these."
        )
    if not places:
        raise InputError(
            "survey.positions_m",
            "no position",
            "at least one, for the design `list`",
            "Give pairs of x and y in metres.",
        )
    return [(x, y, height_m) for x, y in places]


def candidates(size_m: Sequence[float], height_m: float, along: int) -> list[Position]:
    """A square grid of `along` x `along` places from edge to edge [m]."""
    x, y = ([edge * k / (along - 1) for k in range(along)] for edge in size_m[:2])
    return [(east, north, height_m) for east in x for north in y]
