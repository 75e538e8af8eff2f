"""Scans of virtual trees in which every point is known to be leaf or wood, to learn from them.

Trees that a classifier learns from are drawn: no two have a size, a leaf or a scanner in common.
Those on which it is tried are of other kinds, seen by other scanners.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dapple.cloud.clean import clean
from dapple.formats import shots
from dapple.formats.clouds import LEAF, WOOD, Cloud
from dapple.formats.meshes import Mesh
from dapple.streams import stream_seed
from dapple.virtual import conifers, scanner
from dapple.virtual.conifers import HABITS, Habit
from dapple.virtual.plants import apple_tree
from dapple.virtual.scanner_model import Scanner

CONIFER_SHARE = 0.35
"""Of the trees that are drawn."""
VARIED = 0.2
"""Numbers of a conifer's habit are drawn within this share of a known one's."""
ANGLES = ("spherical", "planophile", "erectophile", "plagiophile")

PINE = Habit(
    whorl_step_m=0.5,
    whorl_scatter=0.2,
    branches_per_whorl=5,
    taper=0.6,
    round_base=0.3,
    rise_base_deg=15.0,
    rise_top_deg=60.0,
    droop=0.05,
    twig_step_m=0.22,
    twig_share=0.3,
    twig_angle_deg=40.0,
    twig_droop=0.0,
    bare_share=0.45,
    spread_deg=35.0,
    shoot_angle_deg=20.0,
)
"""Bare inner branches, needles in brushes at their ends (Pinus)."""

UNSEEN: dict[str, dict[str, Any]] = {
    "plane": {
        "height_m": 8.0,
        "crown_base_m": 2.5,
        "crown_radius_m": 2.6,
        "dbh_m": 0.22,
        "leaf_area_m2": 45.0,
        "leaf_length_min_m": 0.14,
        "leaf_length_max_m": 0.20,
        "leaf_angle_distribution": "plagiophile",
        "leaf_fold_deg": 12.0,
        "twig_radius_m": 0.003,
        "n_clumps": 40,
        "twigs_per_leaf_m2": 6.0,
    },
    "beech": {
        "height_m": 7.0,
        "crown_base_m": 1.2,
        "crown_radius_m": 2.2,
        "dbh_m": 0.14,
        "leaf_area_m2": 40.0,
        "leaf_length_min_m": 0.06,
        "leaf_length_max_m": 0.10,
        "leaf_angle_distribution": "planophile",
        "leaf_fold_deg": 5.0,
        "n_clumps": 150,
        "twigs_per_leaf_m2": 20.0,
    },
    "olive": {
        "height_m": 4.5,
        "crown_base_m": 1.4,
        "crown_radius_m": 2.0,
        "dbh_m": 0.25,
        "leaf_area_m2": 18.0,
        "leaf_length_min_m": 0.035,
        "leaf_length_max_m": 0.055,
        "leaf_angle_distribution": "erectophile",
        "twig_radius_m": 0.002,
        "n_clumps": 60,
        "twigs_per_leaf_m2": 30.0,
    },
    "pine": {
        "species": "pine",
        "height_m": 9.0,
        "crown_radius_m": 1.8,
        "crown_base_share": 0.4,
        "dbh_m": 0.17,
        "leaf_area_m2": 30.0,
        "shoot_length_m": 0.22,
        "strips_per_shoot": 5,
    },
}
"""Trees that none of the drawn ones is like; those with a `species` are conifers."""

OTHER_SCANNERS: dict[str, dict[str, Any]] = {
    # One return a shot, of what the beam meets first: a phase-shift scanner.
    "phase": {
        "angular_step_deg": 0.1,
        "beam_divergence_mrad": 0.3,
        "exit_aperture_m": 0.0025,
        "range_noise_m": 0.0015,
        "min_separation_m": 0.1,
        "max_returns": 1,
        "leaf_reflectance_db": (-3.5, 1.0),
        "wood_reflectance_db": (-2.0, 1.0),
    },
    "wide beam": {
        "angular_step_deg": 0.15,
        "beam_divergence_mrad": 1.4,
        "exit_aperture_m": 0.012,
        "range_noise_m": 0.01,
        "min_separation_m": 1.2,
        "max_returns": 3,
        "leaf_reflectance_db": (-10.0, 1.5),
        "wood_reflectance_db": (-5.0, 1.5),
    },
    "time of flight": {"angular_step_deg": 0.1},
}
"""Scanners that none of the drawn ones is like, but the last: the default scan's."""


def draw(number: int, seed: int) -> tuple[dict[str, Mesh], dict[str, Any]]:
    """A tree to learn from, and the settings of its scan.

    Parameters
    ----------
    number : int
        Counts the trees.
    seed : int

    Returns
    -------
    plant : dict of str to Mesh
        `leaf` and `wood`.
    settings : dict
        Of `scan`.
    """
    rng = np.random.default_rng(stream_seed(seed, "labelled", number))
    height_m = rng.uniform(2.0, 6.0)
    sizes = {"height_m": height_m, "dbh_m": 0.025 * height_m * rng.uniform(0.6, 1.6)}
    if rng.random() < CONIFER_SHARE:
        habit = _varied(HABITS[str(rng.choice(sorted(HABITS)))], rng)
        sizes["crown_radius_m"] = height_m * rng.uniform(0.13, 0.3)
        plant = conifers.grow(
            habit,
            **sizes,
            crown_base_share=rng.uniform(0.08, 0.35),
            leaf_area_m2=_area_m2(sizes, rng),
            shoot_length_m=rng.uniform(0.08, 0.2),
            strip_width_m=rng.uniform(0.01, 0.03),
            strips_per_shoot=int(rng.integers(3, 7)),
            seed=number,
        )
        return {"leaf": plant.leaves, "wood": plant.wood}, _survey(rng)
    sizes["crown_radius_m"] = height_m * rng.uniform(0.2, 0.5)
    length_m = 0.03 * 4 ** rng.random()
    grown = apple_tree(
        **sizes,
        crown_base_m=height_m * rng.uniform(0.15, 0.35),
        leaf_area_m2=_area_m2(sizes, rng),
        leaf_length_min_m=0.8 * length_m,
        leaf_length_max_m=1.2 * length_m,
        leaf_angle_distribution=str(rng.choice(ANGLES)),
        leaf_fold_deg=rng.uniform(0, 20),
        twig_radius_m=rng.uniform(0.0012, 0.0035),
        n_clumps=int(rng.integers(20, 200)),
        twigs_per_leaf_m2=10 * 4 ** rng.random(),
        seed=number,
    )
    return {"leaf": grown.leaves, "wood": grown.wood}, _survey(rng)


def unseen(name: str, seed: int, **size: float) -> dict[str, Mesh]:
    """Leaf and wood of a tree of `UNSEEN`, perhaps of another size."""
    settings = UNSEEN[name] | size | {"seed": stream_seed(seed, "unseen", name)}
    if settings.pop("species", None):
        plant = conifers.grow(PINE, **settings)
        return {"leaf": plant.leaves, "wood": plant.wood}
    grown = apple_tree(**settings)
    return {"leaf": grown.leaves, "wood": grown.wood}


def scan(
    plant: Mapping[str, Mesh],
    *,
    positions: int = 6,
    radius_m: float = 8.0,
    thin_voxel_m: float = 0.01,
    seed: int,
    **settings: Any,
) -> Cloud:
    """Cleaned points of a scan around a tree, with what they truly are.

    Parameters
    ----------
    plant : mapping of str to Mesh
        `leaf` and `wood`, the stem on the origin.
    positions : int
    radius_m : float
        On a circle of this radius [m].
    thin_voxel_m : float
        One point is left in a voxel of this size [m].
    seed : int
    **settings
        Fields of `Scanner`.

    Returns
    -------
    Cloud
        With `TrueClass`, `Reflectance` and `BeamShare`: thickness of the wood that a point is of
        over the diameter of the beam there; NaN at leaves.
    """
    places_m = scanner.positions_around(np.zeros(3), radius_m, positions)
    fired = scanner.scan(dict(plant), places_m, ground_z_m=0.0, seed=seed, **settings)
    cloud, _ = clean(
        shots.to_cloud(fired), outlier_backend="none", min_height_m=0.1, thin_voxel_m=thin_voxel_m
    )
    known = np.isin(cloud.attributes["TrueClass"], (WOOD, LEAF))
    cloud = cloud.select(known)
    beam = Scanner(**settings)
    range_m, _ = cKDTree(places_m).query(cloud.xyz_m)
    beam_m = beam.exit_aperture_m + 1e-3 * beam.beam_divergence_mrad * range_m
    is_wood = cloud.attributes["TrueClass"] == WOOD
    share = np.where(is_wood, thickness(plant["wood"], cloud.xyz_m) / beam_m, np.nan)
    return replace(cloud, attributes=cloud.attributes | {"BeamShare": share})


def thickness(wood: Mesh, xyz_m: np.ndarray) -> np.ndarray:
    """Diameter of the nearest segment of wood, or its length where that is less, (n,) [m]."""
    order = np.argsort(wood.element, kind="stable")
    corners = wood.vertices_m[wood.faces[order]].reshape(-1, 3)
    of_corner = np.repeat(wood.element[order], 3)
    starts = np.searchsorted(of_corner, np.arange(wood.n_elements))
    centre = wood.element_centre_m
    far = np.linalg.norm(corners - centre[of_corner], axis=1)
    half_m = np.maximum.reduceat(far, starts)
    # Half a diagonal of a segment: sqrt(l² + d²) / 2, with d = area / (π l).
    side = wood.element_area_m2 / np.pi
    square = 0.5 * (4 * half_m**2 + np.sqrt(np.maximum(16 * half_m**4 - 4 * side**2, 0)))
    _, nearest = cKDTree(centre).query(xyz_m)
    return (side / np.sqrt(square))[nearest]


def _varied(habit: Habit, rng: np.random.Generator) -> Habit:
    numbers: dict[str, Any] = {
        name: value * rng.uniform(1 - VARIED, 1 + VARIED)
        for name, value in habit.__dict__.items()
        if isinstance(value, float)
    }
    return replace(habit, **numbers)


def _area_m2(sizes: Mapping[str, float], rng: np.random.Generator) -> float:
    """Leaves for a leaf area index of 1 to 3 below the crown."""
    return float(np.pi * sizes["crown_radius_m"] ** 2 * rng.uniform(1.0, 3.0))


def _survey(rng: np.random.Generator) -> dict[str, Any]:
    leaf_db = rng.uniform(-10.0, -5.0)
    return {
        "positions": int(rng.integers(1, 9)),
        "radius_m": rng.uniform(4.0, 12.0),
        "thin_voxel_m": rng.uniform(0.005, 0.02),
        "angular_step_deg": 0.09 * 2.5 ** rng.random(),
        "beam_divergence_mrad": rng.uniform(0.2, 0.8),
        "exit_aperture_m": rng.uniform(0.004, 0.01),
        "range_noise_m": rng.uniform(0.002, 0.008),
        "min_separation_m": rng.uniform(0.2, 1.0),
        "leaf_reflectance_db": (leaf_db, rng.uniform(0.8, 2.0)),
        "wood_reflectance_db": (leaf_db + rng.uniform(1.5, 6.0), rng.uniform(0.8, 2.0)),
        "incidence_exponent": rng.uniform(0.2, 1.0),
    }
