"""Leafy shoots: rosettes on short spurs, and long shoots with leaves in a spiral."""

from dataclasses import dataclass

import numpy as np

from dapple.virtual.plant_skeleton import Skeleton, unit
from dapple.virtual.plant_tubes import Axes

_GOLDEN_RAD = np.pi * (3 - np.sqrt(5))
_UP = np.array([0.0, 0.0, 1.0])
_LONG_SHOOT_M = (0.12, 0.35)
_INTERNODE_M = 0.022
_SPUR_M = (0.01, 0.04)
_SPUR_LEAVES = (5, 8)
_PETIOLE_M = (0.015, 0.035)
SPUR_WOOD_RADIUS_M = 0.012
"""Spurs grow on wood thinner than this [m]."""


@dataclass(frozen=True)
class Shoots:
    """Wood of shoots, and where their leaves sit.

    Attributes
    ----------
    wood : Axes
        One axis a shoot.
    leaf_base_m : (n, 3) float64
        Where each blade begins, at the end of its petiole [m].
    petiole : (n, 3) float64
        Unit vectors along the petioles, away from the shoot.
    n_long, n_spurs : int
        Number of shoots of either kind.
    """

    wood: Axes
    leaf_base_m: np.ndarray
    petiole: np.ndarray
    n_long: int
    n_spurs: int


def sprout(
    skeleton: Skeleton, radius_m: np.ndarray, n_leaves: int, rng: np.random.Generator
) -> Shoots:
    """Put a long shoot on every twig's end and spurs along thin wood.

    Parameters
    ----------
    skeleton : Skeleton
    radius_m : (n,) float64
        Radius at its nodes [m].
    n_leaves : int
        Leaf sites wanted; as many spurs are made as that takes (at least one).
    rng : numpy.random.Generator

    Returns
    -------
    Shoots

    Notes
    -----
    Apple bears most of its leaves on spurs of a few centimetres with 5 to 8 leaves, the others on
    extension shoots with about 2 cm between leaves.
    """
    tips = skeleton.tips
    base, along = skeleton.xyz_m[tips], skeleton.direction(tips)
    length = rng.uniform(*_LONG_SHOOT_M, len(tips))
    heading = unit(along + 0.3 * _UP + 0.25 * rng.standard_normal(base.shape))
    n_on_long = np.floor((length - 0.03) / _INTERNODE_M).astype(int) + 1
    long_wood, long_sites = _shoots(
        base, heading, length, radius_m[tips], n_on_long, 0.03, 4, 1.2, rng
    )
    n_spurs = max(int((n_leaves - n_on_long.sum()) / np.mean(_SPUR_LEAVES)) + 1, 1)
    base, along, wood_radius = _places_on_thin_wood(skeleton, radius_m, n_spurs, rng)
    sideways = rng.standard_normal(base.shape) + 0.4 * _UP
    sideways -= (sideways * along).sum(1, keepdims=True) * along
    heading = unit(unit(sideways) + 0.5 * along)
    length = rng.uniform(*_SPUR_M, n_spurs)
    n_on_spur = rng.integers(_SPUR_LEAVES[0], _SPUR_LEAVES[1] + 1, n_spurs)
    spur_radius = np.minimum(wood_radius, 0.0025)
    spur_wood, spur_sites = _shoots(
        base, heading, length, spur_radius, n_on_spur, np.nan, 2, 0.0, rng
    )
    wood = Axes(
        np.concatenate([long_wood.xyz_m, spur_wood.xyz_m]),
        np.concatenate([long_wood.radius_m, spur_wood.radius_m]),
        np.concatenate([long_wood.axis, spur_wood.axis + len(tips)]),
    )
    base_m, petiole = (np.concatenate(pair) for pair in zip(long_sites, spur_sites, strict=True))
    return Shoots(wood, base_m, petiole, len(tips), n_spurs)


def _places_on_thin_wood(skeleton, radius_m, n, rng):
    """Random points on thin wood, evenly by length: position, direction, radius."""
    thin = np.flatnonzero(radius_m < max(SPUR_WOOD_RADIUS_M, 2 * radius_m.min()))
    thin = thin[skeleton.parent[thin] >= 0]
    start, end = skeleton.xyz_m[skeleton.parent[thin]], skeleton.xyz_m[thin]
    reach = np.cumsum(np.linalg.norm(end - start, axis=1))
    at = np.searchsorted(reach, np.sort(rng.uniform(0, reach[-1], n)))
    share = rng.uniform(size=(n, 1))
    return start[at] + share * (end - start)[at], unit(end - start)[at], radius_m[thin][at]


def _shoots(base, heading, length, radius, n_leaves, first_m, n_points, curl, rng):
    """Shoots that curve upwards, and their leaves in a spiral from `first_m` (NaN: at the tip)."""
    n = len(base)

    def place(shoot, s):
        rise = curl * s[:, None] * _UP
        return base[shoot] + s[:, None] * (heading[shoot] + 0.5 * rise), heading[shoot] + rise

    number = np.repeat(np.arange(n), n_points)
    share = np.tile(np.linspace(0, 1, n_points), n)
    taper = 1 - 0.4 * share
    wood = Axes(place(number, share * length[number])[0], radius[number] * taper, number)

    shoot = np.repeat(np.arange(n), n_leaves)
    rank = np.arange(len(shoot)) - np.repeat(np.cumsum(n_leaves) - n_leaves, n_leaves)
    rosette = np.isnan(first_m)
    s = length[shoot] if rosette else np.minimum(first_m + _INTERNODE_M * rank, length[shoot])
    node, tangent = place(shoot, s)
    turn = _GOLDEN_RAD * rank + rng.uniform(0, 2 * np.pi, n)[shoot]
    helper = np.where(np.abs(heading[:, 2:]) < 0.9, [_UP], [[1.0, 0, 0]])[shoot]
    across = unit(np.cross(tangent, helper))
    outwards = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * unit(
        np.cross(tangent, across)
    )
    opening = np.radians(rng.uniform(30, 80, len(shoot)) if rosette else 55.0)
    petiole = unit(
        np.expand_dims(np.cos(opening), -1) * unit(tangent)
        + np.expand_dims(np.sin(opening), -1) * outwards
    )
    petiole_m = rng.uniform(*_PETIOLE_M, len(shoot))
    return wood, (node + petiole_m[:, None] * petiole, petiole)
