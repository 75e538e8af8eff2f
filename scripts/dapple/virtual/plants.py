"""Virtual trees whose every leaf and twig is known."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from dapple.errors import InputError
from dapple.formats.meshes import Mesh, concatenate
from dapple.streams import stream_seed
from dapple.virtual import leaf_shapes, plant_skeleton, plant_tubes
from dapple.virtual.plant_shoots import Shoots, sprout
from dapple.virtual.plant_sizes import TWIG_RADIUS_M, check_leaves, check_sizes
from dapple.virtual.plant_skeleton import Skeleton

_SPARE = 1.06  # leaves made for each one asked, to drop some by chance
_WIDTH_PER_LENGTH = (0.55, 0.68)


@dataclass(frozen=True)
class Plant:
    """A tree and its true measures.

    Attributes
    ----------
    leaves : Mesh
        One element a leaf.
    wood : Mesh
        One element a branch segment.
    height_m, crown_base_m : float
        Height of the highest point and of the lowest leaf above the ground [m].
    dbh_m : float
        Stem diameter at `breast_height_m`, from the girth [m].
    breast_height_m : float
        1.3 m, or 0.65 of the crown base where that is lower [m].
    crown_projection_m2 : float
        Area of the convex hull of the leaves, seen from above [m²].
    n_spurs, n_long_shoots : int
        Shoots that leaves sit on.
    """

    leaves: Mesh
    wood: Mesh
    height_m: float
    crown_base_m: float
    dbh_m: float
    breast_height_m: float
    crown_projection_m2: float
    n_spurs: int
    n_long_shoots: int

    def facts(self) -> dict:
        """Measures as a flat dictionary, areas one-sided [m²], for a summary file."""
        span = np.ptp(self.leaves.vertices_m, axis=0)
        return {
            "leaf_area_m2": self.leaves.area_m2,
            "true_leaf_area_m2": self.leaves.area_m2,
            "wood_area_m2": self.wood.area_m2,
            "n_elements": self.leaves.n_elements,
            "n_wood_elements": self.wood.n_elements,
            "volume_m3": float(span.prod()),
            "n_leaves": self.leaves.n_elements,
            "n_triangles": len(self.leaves.faces) + len(self.wood.faces),
            "height_m": self.height_m,
            "crown_base_m": self.crown_base_m,
            "dbh_m": self.dbh_m,
            "breast_height_m": self.breast_height_m,
            "crown_projection_m2": self.crown_projection_m2,
            "n_spurs": self.n_spurs,
            "n_long_shoots": self.n_long_shoots,
        }


def apple_tree(
    *,
    height_m: float = 6.6,
    crown_base_m: float = 2.1,
    crown_radius_m: float = 3.78,
    dbh_m: float = 0.19,
    leaf_area_m2: float = 90.0,
    leaf_length_min_m: float = 0.05,
    leaf_length_max_m: float = 0.08,
    leaf_angle_distribution: str = "spherical",
    leaf_fold_deg: float = 10.0,
    twig_radius_m: float = TWIG_RADIUS_M,
    n_clumps: int = 70,
    twigs_per_leaf_m2: float = 25.0,
    seed: int,
) -> Plant:
    """Grow an apple tree (*Malus domestica*) on the origin of the local frame.

    Parameters
    ----------
    height_m : float
        Height of the highest twig or leaf [m].
    crown_base_m : float
        No leaf is lower than this [m].
    crown_radius_m : float
        Radius of the circle that is as large as the crown's projection (convex hull) [m].
    dbh_m : float
        Stem diameter at 1.3 m (at 0.65 of the crown base where that is lower) [m].
    leaf_area_m2 : float
        One-sided area of all leaves [m²]; met to within half a leaf.
    leaf_length_min_m, leaf_length_max_m : float
        Blade lengths, uniform between these [m]; widths are 0.55 to 0.68 of them.
    leaf_angle_distribution : str
        Of the leaves' normals; `spherical`, `planophile`, ...
    leaf_fold_deg : float
        Angle by which each half of a blade is raised from the plane of its leaf [°].
    twig_radius_m : float
        Radius of the thinnest branches, whose ends carry the shoots [m].
    n_clumps : int
        Foliage gathers in so many clumps: fewer make a crown with more gaps.
    twigs_per_leaf_m2 : float
        Points that branches grow towards, for each m² of leaves [m⁻²].
    seed : int
        The tree is a function of the parameters and the seed alone.

    Returns
    -------
    Plant

    Raises
    ------
    InputError
        A size that no tree can have.

    Notes
    -----
    Default size: the tree of Frey et al. (2025), section 2.1. Petioles are not meshed.
    """
    check_sizes(height_m, crown_base_m, crown_radius_m, dbh_m, leaf_area_m2, twig_radius_m)
    check_leaves(leaf_length_min_m, leaf_length_max_m, leaf_fold_deg, n_clumps)
    n_tips = max(round(twigs_per_leaf_m2 * leaf_area_m2), 30)
    skeleton = plant_skeleton.grow(
        height_m, crown_base_m, crown_radius_m, n_tips, n_clumps, _rng(seed, "skeleton")
    )
    breast_height_m = min(1.3, 0.65 * crown_base_m)
    mean_length_2 = np.mean(np.linspace(leaf_length_min_m, leaf_length_max_m, 101) ** 2)
    mean_leaf_m2 = leaf_shapes.BLADE_FORM * np.mean(_WIDTH_PER_LENGTH) * mean_length_2
    n_leaves = max(int(_SPARE * leaf_area_m2 / mean_leaf_m2), 10)

    def leafy(skeleton: Skeleton) -> tuple[np.ndarray, Shoots, Mesh]:
        radius = plant_skeleton.radii(skeleton, dbh_m, breast_height_m, twig_radius_m)
        shoots = sprout(skeleton, radius, n_leaves, _rng(seed, "shoots"))
        lengths_m = (leaf_length_min_m, leaf_length_max_m)
        leaves = _leaves(
            shoots, lengths_m, leaf_angle_distribution, leaf_fold_deg, _rng(seed, "leaves")
        )
        return radius, shoots, leaves

    projection_m2 = np.pi * crown_radius_m**2
    skeleton = _fit(skeleton, leafy, height_m, crown_base_m, projection_m2)
    radius, shoots, leaves = leafy(skeleton)
    leaves = _thin(leaves, leaf_area_m2, crown_base_m, height_m, _rng(seed, "thin"))
    branches = plant_tubes.of_skeleton(skeleton, radius)
    wood = concatenate([plant_tubes.tubes(branches), plant_tubes.tubes(shoots.wood)])
    return Plant(
        leaves,
        wood,
        float(max(leaves.vertices_m[:, 2].max(), wood.vertices_m[:, 2].max())),
        float(leaves.vertices_m[:, 2].min()),
        _diameter(branches, breast_height_m),
        breast_height_m,
        _hull_m2(leaves.vertices_m),
        shoots.n_spurs,
        shoots.n_long,
    )


def _rng(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng(stream_seed(seed, "apple_tree", name))


def _leaves(shoots: Shoots, lengths_m, distribution: str, fold_deg: float, rng) -> Mesh:
    """A blade on every site, in random order."""
    order = rng.permutation(len(shoots.leaf_base_m))
    length = rng.uniform(*lengths_m, len(order))
    width = length * rng.uniform(*_WIDTH_PER_LENGTH, len(order))
    normal = leaf_shapes.draw_normals(len(order), distribution, rng)
    return leaf_shapes.blades(
        shoots.leaf_base_m[order], shoots.petiole[order], normal, length, width, fold_deg
    )


def _fit(skeleton, leafy, height_m, crown_base_m, projection_m2) -> Skeleton:
    """Stretch a tree until, with its leaves on, it is as high and as wide as asked."""
    for _ in range(4):
        _, shoots, leaves = leafy(skeleton)
        points = np.concatenate([leaves.vertices_m, shoots.wood.xyz_m])
        points = points[points[:, 2] > crown_base_m]
        sideways = np.sqrt(projection_m2 / _hull_m2(points))
        aim_m = height_m - 0.005  # twigs have a thickness
        upwards = (aim_m - crown_base_m) / (points[:, 2].max() - crown_base_m)
        skeleton = skeleton.stretched(sideways, upwards, crown_base_m)
    return skeleton


def _thin(leaves: Mesh, leaf_area_m2, lowest_m, highest_m, rng) -> Mesh:
    """Keep leaves between the heights, by chance, until their area is as asked."""
    z_m = leaves.vertices_m[:, 2].reshape(leaves.n_elements, -1)
    inside = np.flatnonzero((z_m.min(1) >= lowest_m) & (z_m.max(1) <= highest_m))
    order = rng.permutation(inside)
    area_m2 = np.cumsum(leaves.element_area_m2[order])
    if area_m2[-1] < leaf_area_m2 - leaves.element_area_m2.max():
        raise InputError(
            "plant.leaf_area_m2",
            f"{leaf_area_m2:g} m², of which {area_m2[-1]:.3g} m² found a place",
            "an area that the crown can carry",
            "Ask for less, or for a larger crown.",
        )
    n = int(np.argmin(np.abs(area_m2 - leaf_area_m2))) + 1
    return leaf_shapes.pick(leaves, np.sort(order[:n]))


def _diameter(branches: plant_tubes.Axes, height_m: float) -> float:
    """Diameter of the stem, the first axis, at a height [m]."""
    stem = branches.axis == 0
    return float(2 * np.interp(height_m, branches.xyz_m[stem, 2], branches.radius_m[stem]))


def _hull_m2(points_m: np.ndarray) -> float:
    """Area of the convex hull of points seen from above [m²]."""
    return float(ConvexHull(points_m[:, :2]).volume)
