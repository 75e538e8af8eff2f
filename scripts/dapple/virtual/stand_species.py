"""Species that stands are made of, and what a stand of them needs."""

from collections.abc import Sequence
from typing import Any

from dapple.errors import InputError

SPECIES: dict[str, dict] = {
    # dense fine branching, many small flat leaves in layers (European beech)
    "fagus": {
        "height_m": 26.0,
        "crown_base_m": 4.0,
        "crown_radius_m": 3.35,
        "dbh_m": 0.42,
        "leaf_length_min_m": 0.06,
        "leaf_length_max_m": 0.10,
        "leaf_angle_distribution": "planophile",
        "leaf_fold_deg": 5.0,
        "n_clumps": 400,
        "twigs_per_leaf_m2": 20.0,
    },
    # few thick branches, large leaves at all angles, gathered in clumps with gaps (plane tree)
    "platanus": {
        "height_m": 28.0,
        "crown_base_m": 7.0,
        "crown_radius_m": 3.35,
        "dbh_m": 0.55,
        "leaf_length_min_m": 0.14,
        "leaf_length_max_m": 0.22,
        "leaf_angle_distribution": "plagiophile",
        "leaf_fold_deg": 12.0,
        "twig_radius_m": 0.003,
        "n_clumps": 60,
        "twigs_per_leaf_m2": 4.0,
    },
}
"""Full-grown trees of a closed stand, as parameters of `plants.apple_tree`."""


def of_stand(
    species: str,
    positions_m: Sequence[Sequence[float]],
    size_m: Sequence[float],
    leaf_area_index: float,
    **changes: Any,
) -> dict[str, Any]:
    """Parameters of `plants.apple_tree` for the trees of a stand.

    Parameters
    ----------
    species : str
        A key of `SPECIES`.
    positions_m : pairs of floats
        Places of the trees, east and north [m].
    size_m : three floats
        Edges of the box that the stand fills [m].
    leaf_area_index : float
        Leaf area over the area of the box.
    **changes
        Parameters that differ from the species'.

    Raises
    ------
    InputError
        An unknown species, no tree or no leaf, a tree outside the box or higher than it.
    """
    if species not in SPECIES:
        raise InputError(
            "survey.stands", species, ", ".join(SPECIES), "Name a species that dapple can grow."
        )
    if not len(positions_m) or not leaf_area_index > 0:
        raise InputError(
            "survey.trees_m",
            f"{len(positions_m)} trees, leaf area index {leaf_area_index:g}",
            "at least one tree with leaves",
            "An empty stand has nothing to scan.",
        )
    if not all(0 <= x < size_m[0] and 0 <= y < size_m[1] for x, y in positions_m):
        raise InputError(
            "survey.trees_m",
            str([list(tree) for tree in positions_m]),
            f"positions from 0 to {size_m[0]:g} and {size_m[1]:g} m",
            "Move the trees into survey.volume_m or enlarge it.",
        )
    settings = SPECIES[species] | changes
    if settings["height_m"] > size_m[2]:
        raise InputError(
            "survey.volume_m",
            f"a height of {size_m[2]:g} m",
            f"at least the trees' {settings['height_m']:g} m",
            "Raise the volume.",
        )
    return settings
