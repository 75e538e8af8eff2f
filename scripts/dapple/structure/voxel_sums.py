"""What shots tell about each voxel of a grid that they are followed through, added up."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dapple.errors import InputError
from dapple.formats.shots import Shots
from dapple.structure import estimators, leaf_angles, returns, traversal
from dapple.structure.returns import Kinds

_ROUNDING = 1e-6
"""Share of a voxel by which places of returns and distances along beams may differ."""


@dataclass(frozen=True)
class Grid:
    """Cubic voxels in the local frame.

    Attributes
    ----------
    corner_m : (3,) float64
        Lowest corner [m].
    shape : tuple of int
        Number of voxels along x, y, z.
    size_m : float
        Edge of a voxel [m].
    """

    corner_m: np.ndarray
    shape: tuple[int, int, int]
    size_m: float

    @classmethod
    def around(cls, bounds_m: np.ndarray, size_m: float) -> "Grid":
        """The smallest grid around a box (2, 3) whose facets lie at multiples of the size."""
        low, high = np.asarray(bounds_m, np.float64) / size_m
        first = np.floor(low + 1e-9)
        last = np.maximum(np.ceil(high - 1e-9), first + 1)
        n_x, n_y, n_z = (last - first).astype(int).tolist()
        return cls(first * size_m, (n_x, n_y, n_z), float(size_m))

    @property
    def n_voxels(self) -> int:
        return math.prod(self.shape)

    @property
    def centres_m(self) -> dict[str, np.ndarray]:
        """Coordinates of the voxels' centres along `x`, `y`, `z` [m]."""
        return {
            axis: self.corner_m[k] + (np.arange(self.shape[k]) + 0.5) * self.size_m
            for k, axis in enumerate("xyz")
        }


@dataclass(frozen=True)
class Sums:
    """What all shots left in each voxel; see `traversal` for the columns.

    Attributes
    ----------
    grid : Grid
    visits, hits : (v, columns) float64
        Of everything that entered, and of leaf hits.
    n_hit_parts, n_touched_parts : (v,) int64
        Sub-voxels with a leaf hit, and, where there are such, with any beam.
    u_max : float
        Longest optical path in a voxel [m].
    max_pad_m2_m3 : float
        Cap of plant area density.
    n_shots, n_misses, n_scans : int
    world_origin_m : (3,) float64
        World coordinates of the local origin [m].
    settings : dict
        By which shots were followed.
    """

    grid: Grid
    visits: np.ndarray
    hits: np.ndarray
    n_hit_parts: np.ndarray
    n_touched_parts: np.ndarray
    u_max: float
    max_pad_m2_m3: float
    n_shots: int
    n_misses: int
    n_scans: int
    world_origin_m: np.ndarray
    settings: dict


def accumulate(
    chunks: Shots | Iterable[Shots],
    grid: Grid,
    *,
    kinds: Kinds = None,
    leaf_angle_distribution: str = "spherical",
    single_leaf_area_m2: float = 0.0,
    max_pad_m2_m3: float = 5.0,
    contact_voxel_m: float = 0.05,
    beam_divergence_mrad: float = 0.0,
    beam_diameter_m: float = 0.0,
    allow_missing_misses: bool = False,
) -> Sums:
    """Follow shots through a grid and add up what they tell about each voxel.

    A shot enters a voxel with the share of its beam that earlier echoes left over; n echoes take
    1/n each. Echoes of wood and noise weaken the beam like any other but are no hit: their share
    has travelled up to them without meeting a leaf. A miss crosses the whole grid.

    Parameters
    ----------
    chunks : Shots or iterable of Shots
        Taken one at a time, and twice for the contact frequency: the first time for where returns
        are. An iterator, which gives its chunks once, takes longer for the same sums.
    grid : Grid
    kinds : callable, (m,) uint8 or None
        What each return is: 0 leaf, 1 wood, 2 noise. A function of a chunk, an array for the
        returns of all chunks one after another, or None where all are leaf.
    leaf_angle_distribution : str
        One of `leaf_angles.DISTRIBUTIONS`; G is taken at each shot's own angle.
    single_leaf_area_m2 : float
        One-sided area s of a leaf, for the finite-element correction of free paths in the
        estimators `fpl` and `fpl_biased`; 0, the default: no correction. A path z counts as
        -ln(1 - λ₁z)/λ₁ with λ₁ = G·s/V for elements of area s in a voxel of volume V (derived in
        `traversal._effective`; Pimont et al. 2018), which are the parts of leaves that lie in it
        (`part_of_leaf`). AMAPVox takes λ₁ = 0.25/V times the area that it is given, as if leaves
        lay wholly in a voxel. Where leaves are folded or lie against each other, no measured leaf
        area stands for what a beam can tell apart, hence the default.
    max_pad_m2_m3 : float
        Cap of plant area density.
    contact_voxel_m : float
        Sub-voxels of the contact frequency: a voxel's edge is cut into the whole number of parts
        that comes nearest to this size. 0: no contact frequency.
    beam_divergence_mrad, beam_diameter_m : float
        Full divergence, and diameter at exit: shots are weighted by their beam's section at the
        voxel's centre. Both 0: every shot counts the same.
    allow_missing_misses : bool
        Go on where every shot has a return.

    Returns
    -------
    Sums
        The same bytes whatever the number of threads. Memory is 8 bytes × about 25 columns × two to
        four blocks a voxel, and does not grow with the number of shots.

    Raises
    ------
    MissingMissesError
        Every shot has a return: plant area density would have no denominator.
    InputError
        No shot, ranges that are not finite or not in ascending order, kinds of another length,
        a direction that is no unit vector, a cap too high for the voxel size, or a leaf that
        could fill a voxel's section.
    """
    u_max = math.sqrt(3) * grid.size_m * _largest_projection(leaf_angle_distribution)
    _check_leaf(single_leaf_area_m2, u_max, grid.size_m)
    count = estimators.n_moments(max_pad_m2_m3 * u_max)
    n_parts = max(1, round(grid.size_m / contact_voxel_m)) if contact_voxel_m > 0 else 0
    # A number of blocks that depends on the grid alone keeps sums the same on any machine.
    n_blocks = 4 if grid.n_voxels <= 200_000 else 2
    visits = np.zeros((n_blocks, grid.n_voxels, traversal.VISIT_MOMENTS + count))
    hits = np.zeros((n_blocks, grid.n_voxels, traversal.HIT_MOMENTS + count))
    touched, hit = np.zeros((2, n_blocks, grid.n_voxels, -(-(n_parts**3) // 64)), np.uint64)
    has_parts = np.full(grid.n_voxels, n_parts > 0)
    if n_parts and not isinstance(chunks, Iterator):
        has_parts = _with_returns(chunks, grid)
    beam = np.array([math.tan(beam_divergence_mrad / 2000), beam_diameter_m])
    n_shots = n_misses = n_returns = 0
    scans: set[int] = set()
    world_origin_m = np.zeros(3)
    for chunk in [chunks] if isinstance(chunks, Shots) else chunks:
        returns.check_chunk(chunk)
        kind = returns.kinds_of_chunk(kinds, chunk, n_returns)
        zenith = np.arccos(np.minimum(np.abs(chunk.direction[:, 2]), 1.0).astype(np.float64))
        traversal.accumulate(
            np.ascontiguousarray(chunk.origin_m, np.float64),
            np.ascontiguousarray(chunk.direction, np.float64),
            zenith,
            leaf_angles.projection(leaf_angle_distribution, zenith),
            np.ascontiguousarray(chunk.first, np.int64),
            np.ascontiguousarray(chunk.range_m, np.float64),
            kind,
            np.asarray(grid.corner_m, np.float64),
            np.array(grid.shape, np.int64),
            float(grid.size_m),
            beam,
            part_of_leaf(single_leaf_area_m2, grid.size_m) / grid.size_m**3,
            u_max,
            n_parts,
            has_parts,
            visits,
            hits,
            touched,
            hit,
        )
        n_shots += len(chunk)
        scans.update(np.unique(chunk.scan).tolist())
        n_misses += int(np.count_nonzero(chunk.n_returns == 0))
        n_returns += len(chunk.range_m)
        world_origin_m = np.asarray(chunk.world_origin_m, np.float64)
    returns.check_all(kinds, n_shots, n_misses, n_returns, allow_missing_misses)
    for block in range(1, n_blocks):
        visits[0] += visits[block]
        hits[0] += hits[block]
        touched[0] |= touched[block]
        hit[0] |= hit[block]
    n_hit = np.bitwise_count(hit[0]).sum(axis=1, dtype=np.int64)
    n_touched = np.bitwise_count(touched[0]).sum(axis=1, dtype=np.int64)
    settings = {
        "leaf_angle_distribution": leaf_angle_distribution,
        "single_leaf_area_m2": single_leaf_area_m2,
        "max_pad_m2_m3": max_pad_m2_m3,
        "contact_voxel_m": grid.size_m / n_parts if n_parts else 0.0,
        "beam_divergence_mrad": beam_divergence_mrad,
        "beam_diameter_m": beam_diameter_m,
    }
    return Sums(
        grid,
        visits[0],
        hits[0],
        n_hit,
        np.where(n_hit > 0, n_touched, 0),
        u_max,
        max_pad_m2_m3,
        n_shots,
        n_misses,
        len(scans),
        world_origin_m,
        settings,
    )


def part_of_leaf(leaf_area_m2: float, size_m: float) -> float:
    """Mean area of the parts into which voxels cut a round leaf, each counted by its area [m²].

    Elements of areas a leave a path z free with Π(1 - G·a·z/V), whose logarithm is to second order
    that of equal elements of Σa²/Σa. The sum of squares of a leaf's parts is its area squared times
    the chance that two of its points share a voxel, Π(1 - |Δₖ|/size), with Δ the way from one to
    the other: any direction, and lengths whose moments are those of two points in a disc (Solomon
    1978, Geometric Probability).
    """
    x = math.sqrt(leaf_area_m2 / math.pi) / size_m
    mean, mean_of_cubes = 128 / (45 * math.pi), 2048 / (525 * math.pi)  # of squares: 1
    return leaf_area_m2 * (
        1 - 1.5 * mean * x + 2 / math.pi * x**2 - mean_of_cubes / (4 * math.pi) * x**3
    )


def _with_returns(chunks: Shots | Iterable[Shots], grid: Grid) -> np.ndarray:
    """(v,) bool, voxels with a return in them or, but for rounding, on their facets."""
    found = np.zeros(grid.n_voxels, bool)
    for chunk in [chunks] if isinstance(chunks, Shots) else chunks:
        place = (chunk.return_xyz_m - grid.corner_m) / grid.size_m
        on_facet = (np.abs(place - np.round(place)) < _ROUNDING).any(axis=1)
        beside = _ROUNDING * (2 * np.argwhere(np.ones((2, 2, 2))) - 1)
        for some in (place, *(place[on_facet] + one for one in beside)):
            inside = ((some >= 0) & (some < grid.shape)).all(axis=1)
            found[np.ravel_multi_index(tuple(some[inside].astype(np.int64).T), grid.shape)] = True
    return found


def _largest_projection(distribution: str) -> float:
    return float(leaf_angles.projection(distribution, np.linspace(0, np.pi / 2, 1801)).max())


def _check_leaf(single_leaf_area_m2: float, u_max: float, size_m: float) -> None:
    """Refuse leaves of which one could darken a voxel: the correction has no answer there."""
    largest = size_m**3 / u_max
    if single_leaf_area_m2 >= largest:
        raise InputError(
            "voxels.single_leaf_area_m2",
            f"{single_leaf_area_m2} m² in voxels of {size_m} m",
            f"less than {largest:.2g} m²",
            "Take larger voxels, or 0 for no finite-element correction.",
        )
