"""Virtual leaf polygons along real wood, where the leaves themselves are not known."""

import numpy as np
from scipy.spatial import cKDTree

from dapple.errors import EmptyCloudError, InputError
from dapple.formats.meshes import Mesh
from dapple.streams import stream_seed
from dapple.virtual import leaf_shapes
from dapple.virtual.plant_skeleton import unit

_HEXAGON_FORM = 1.5 * np.sqrt(3)  # area of a regular hexagon per squared radius
_UP = np.array([0.0, 0.0, 1.0])


def along_wood(
    wood: Mesh,
    *,
    leaf_area_m2: float = 187.0,
    n_elements: int = 147_098,
    small_share: float = 40_190 / 147_098,
    voxel_size_m: float = 0.05,
    crown_base_m: float = 2.1,
    height_m: float = 6.6,
    max_distance_m: float = 0.3,
    clump_radius_m: float = 0.04,
    thin_wood_m2: float = 0.001,
    leaves_per_shoot: int = 128,
    leaf_angle_distribution: str = "spherical",
    seed: int,
) -> Mesh:
    """Place leaf polygons by chance on shoots that spring from thin wood.

    What a scan shows as wood is what leaves do not hide, so the shoots are not known: they are
    drawn. One placement is one possible crown; light should be averaged over several seeds.

    Parameters
    ----------
    wood : Mesh
        Wood polygons, one element each, the lowest of them at the stem's foot.
    leaf_area_m2 : float
        Total one-sided area of the polygons, met exactly [m²].
    n_elements : int
        Number of polygons; each has a voxel of its own.
    small_share : float
        Share of polygons that stand for voxels with one or two points: hexagons a third of the
        voxel wide. They go where the fewest leaves fell.
    voxel_size_m : float
        Edge of these voxels, laid from the local origin [m].
    crown_base_m : float
        No polygon's voxel lower than this above the lowest point of the wood [m].
    height_m : float
        None higher than this above that point [m].
    max_distance_m : float
        Longest shoot, and largest distance of a leaf from the nearest wood [m].
    clump_radius_m : float
        Standard deviation of the leaves across their shoot [m].
    thin_wood_m2 : float
        Wood polygons of this area carry half as many shoots as small ones, larger ones fewer:
        twigs fill little of a voxel, limbs much of it [m²].
    leaves_per_shoot : int
        Tries to place a polygon on each shoot; more make fewer, denser shoots and larger gaps.
    leaf_angle_distribution : str
        Of the polygons' normals; `spherical`, `planophile`, ...
    seed : int
        Different seeds give independent placements.

    Returns
    -------
    Mesh
        One element a polygon, fanned from its first corner.

    Raises
    ------
    EmptyCloudError
        The wood has no polygon.
    InputError
        No room for so many polygons, or areas that do not go together.

    Notes
    -----
    Areas and counts by default: what Frey et al. (2025) found for the leaves of an apple tree.
    The distances by default are a compromise on that tree's wood: they give a crown projection
    of 44 m² (published 44.8) and about 7,950 voxels of 0.2 m with leaves (6,960). Denser shoots
    come closer to the second and leave outer wood bare. The published 108 voxels of 1 m are out
    of reach: the wood in the crown alone lies in 156, but about 100 hold 95 % of the polygons.
    """
    if not wood.n_elements:
        raise EmptyCloudError(
            "wood", "no polygon", "the polygons of a tree's wood", "Check the wood's file."
        )
    area_m2 = _areas(leaf_area_m2, n_elements, small_share, voxel_size_m, _rng(seed, "areas"))
    foot_m = float(wood.vertices_m[wood.faces, 2].min())
    at_m, n_near = _positions(
        wood, n_elements, voxel_size_m, (foot_m + crown_base_m, foot_m + height_m), max_distance_m,
        clump_radius_m, thin_wood_m2, leaves_per_shoot, _rng(seed, "positions"),
    )  # fmt: skip
    rng = _rng(seed, "shapes")
    small = np.zeros(n_elements, bool)
    fewest_first = np.lexsort([rng.uniform(size=n_elements), n_near])
    small[fewest_first[: _n_small(n_elements, small_share)]] = True
    polygon_m2 = np.empty(n_elements)
    polygon_m2[small], polygon_m2[~small] = np.split(area_m2, [small.sum()])

    centre_m = (np.floor(at_m / voxel_size_m) + 0.5) * voxel_size_m
    room = np.clip(1 - 2 * np.sqrt(polygon_m2 / np.pi) / voxel_size_m, 0.05, 1)
    return leaf_shapes.fans(
        centre_m + room[:, None] * (at_m - centre_m),
        leaf_shapes.draw_normals(n_elements, leaf_angle_distribution, rng),
        polygon_m2,
        np.where(small, 6, rng.integers(4, 9, n_elements)),
        np.where(small, 1.0, rng.uniform(0.55, 0.95, n_elements)),
        rng,
    )


def _positions(wood, n, voxel_m, between_m, max_distance_m, clump_m, thin_m2, n_tries, rng):
    """A point in each of n voxels, and how many points fell into each voxel in all."""
    centre_m, area_m2 = wood.element_centre_m, wood.element_area_m2
    nearest = cKDTree(centre_m)
    vigour = 1 / (1 + (area_m2 / thin_m2) ** 2)
    lowest_m, highest_m = between_m
    half_depth_m = 0.5 * (highest_m - lowest_m - voxel_m)
    vigour[centre_m[:, 2] < lowest_m - max_distance_m] = 0
    if not vigour.any():
        raise InputError(
            "leaves.crown_base_m", f"no wood above {lowest_m:g} m", "wood in the crown",
            "Lower the crown base.",
        )  # fmt: skip
    vigour /= vigour.sum()
    middle = (vigour[:, None] * centre_m).sum(axis=0)
    first_m = np.empty((0, 3))
    n_near = np.empty(0, np.int64)
    without_news = 0
    n_shoots = int(np.clip(n // n_tries, 16, 512))  # at a time
    while len(first_m) < n:
        foot = centre_m[rng.choice(len(centre_m), n_shoots, p=vigour)]
        drawn = _on_shoots(foot, middle, max_distance_m, clump_m, n_tries, rng)
        voxel_z_m = voxel_m * (np.floor(drawn[:, 2] / voxel_m) + 0.5)
        drawn = drawn[np.abs(voxel_z_m - 0.5 * (lowest_m + highest_m)) <= half_depth_m]
        drawn = drawn[np.isfinite(nearest.query(drawn, distance_upper_bound=max_distance_m)[0])]
        before = len(first_m)
        first_m, n_near = _add(first_m, n_near, drawn, voxel_m)
        without_news = without_news + 1 if len(first_m) - before < 1e-4 * len(drawn) else 0
        if without_news == 5:
            raise InputError(
                "leaves.n_elements", f"{n} polygons, and voxels for about {len(first_m)}",
                "a voxel for each within reach of the wood",
                "Ask for fewer, or raise leaves.max_distance_m.",
            )  # fmt: skip
    return first_m[:n], n_near[:n]


def _on_shoots(foot_m, middle_m, length_m, clump_m, n_tries, rng) -> np.ndarray:
    """Points about straight shoots that lead outwards and up from their feet."""
    outwards = unit(foot_m - middle_m + 1e-9)
    heading = unit(unit(rng.standard_normal(foot_m.shape)) + 0.3 * outwards + 0.2 * _UP)
    reach = length_m * rng.uniform(0.2, 1.0, (len(foot_m), 1, 1))
    along = reach * rng.uniform(size=(len(foot_m), n_tries, 1))
    spread = clump_m * rng.standard_normal((len(foot_m), n_tries, 3))
    return (foot_m[:, None] + along * heading[:, None] + spread).reshape(-1, 3)


def _add(first_m, n_near, drawn_m, voxel_m) -> tuple[np.ndarray, np.ndarray]:
    """Put points into voxels: the first of each stays, the others are counted."""
    points = np.concatenate([first_m, drawn_m])
    voxel = np.floor(points / voxel_m).astype(np.int64) + (1 << 20)
    key = (voxel[:, 0] << 42) | (voxel[:, 1] << 21) | voxel[:, 2]
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    count = np.bincount(which, np.concatenate([n_near, np.ones(len(drawn_m))]))
    order = np.argsort(first)
    return points[first[order]], count[order].astype(np.int64)


def _n_small(n_elements: int, small_share: float) -> int:
    return round(small_share * n_elements)


def _areas(leaf_area_m2, n_elements, small_share, voxel_m, rng) -> np.ndarray:
    """Areas of the small polygons, then of the others; together as asked [m²]."""
    n_small = _n_small(n_elements, small_share)
    hexagon_m2 = _HEXAGON_FORM * (voxel_m / 6) ** 2
    rest_m2 = leaf_area_m2 - n_small * hexagon_m2
    if n_elements < 1 or not 0 <= small_share <= 1 or n_small == n_elements or rest_m2 <= 0:
        raise InputError(
            "leaves.leaf_area_m2",
            f"{leaf_area_m2:g} m² in {n_elements} polygons, {n_small} of them small "
            f"({hexagon_m2 * 1e4:.2g} cm² each)",
            "area left for at least one larger polygon",
            "Raise the area, or lower n_elements or small_share.",
        )
    others = rng.beta(2, 2, n_elements - n_small)
    return np.concatenate([np.full(n_small, hexagon_m2), others * (rest_m2 / others.sum())])


def _rng(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng(stream_seed(seed, "along_wood", name))
