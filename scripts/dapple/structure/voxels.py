"""Plant area density in voxels, from shots that are followed through a grid."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from dapple.errors import InputError
from dapple.formats.shots import Shots
from dapple.structure import estimators, leaf_angles, returns, traversal
from dapple.structure.returns import Kinds

ESTIMATORS = ("transmittance", "ppl", "fpl", "fpl_biased", "contact_frequency")
"""Beer-Lambert; maximum likelihood on potential and on free path length, the latter corrected for
bias and as it is; Hosoi and Omasa's contact frequency."""

NOT_REACHED, TOO_FEW_SHOTS, CAPPED = 1, 2, 4
"""Bits of the variable `flag`."""


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
    """What all shots left in each voxel; see `traversal` for the columns."""

    grid: Grid
    visits: np.ndarray
    hits: np.ndarray
    n_hit_parts: np.ndarray
    n_touched_parts: np.ndarray
    u_max: float
    max_pad_m2_m3: float
    n_shots: int
    n_misses: int
    world_origin_m: np.ndarray
    settings: dict


def plant_area_density(
    chunks: Shots | Iterable[Shots],
    grid: Grid,
    *,
    kinds: Kinds = None,
    estimator: str = "fpl",
    leaf_angle_distribution: str = "spherical",
    single_leaf_area_m2: float = 0.0,
    max_pad_m2_m3: float = 5.0,
    min_shots: int = 5,
    contact_voxel_m: float = 0.05,
    beam_divergence_mrad: float = 0.0,
    beam_diameter_m: float = 0.0,
    allow_missing_misses: bool = False,
) -> xr.Dataset:
    """Estimate plant area density in the voxels of a grid.

    `accumulate`, then `estimate`: parameters, result and errors are theirs. Where wood stands
    among the leaves, `fpl` is the estimator that stays right (see `estimators`).
    """
    sums = accumulate(
        chunks,
        grid,
        kinds=kinds,
        leaf_angle_distribution=leaf_angle_distribution,
        single_leaf_area_m2=single_leaf_area_m2,
        max_pad_m2_m3=max_pad_m2_m3,
        contact_voxel_m=contact_voxel_m,
        beam_divergence_mrad=beam_divergence_mrad,
        beam_diameter_m=beam_diameter_m,
        allow_missing_misses=allow_missing_misses,
    )
    return estimate(sums, estimator=estimator, min_shots=min_shots)


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
        Taken one at a time, once.
    grid : Grid
    kinds : callable, (m,) uint8 or None
        What each return is: 0 leaf, 1 wood, 2 noise. A function of a chunk, an array for the
        returns of all chunks one after another, or None where all are leaf.
    leaf_angle_distribution : str
        One of `leaf_angles.DISTRIBUTIONS`; G is taken at each shot's own angle.
    single_leaf_area_m2 : float
        One-sided area s of a leaf, for the finite-element correction of free paths in the
        estimators `fpl` and `fpl_biased`; 0, the default: no correction. A path z counts as
        -ln(1 - λ₁z)/λ₁ with λ₁ = G·s/V for a voxel of volume V (derived in
        `traversal._effective`; Pimont et al. 2018). AMAPVox takes λ₁ = 0.25/V times the area that
        it is given: half its number gives the same answer here with spherical leaf angles. The
        area is that of the mean element that a beam can tell from others: where leaves are folded
        or lie against each other, no measured leaf area stands for it, hence the default.
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
    touched, hit = np.zeros((2, grid.n_voxels, n_parts**3), np.uint8)
    beam = np.array([math.tan(beam_divergence_mrad / 2000), beam_diameter_m])
    n_shots = n_misses = n_returns = 0
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
            single_leaf_area_m2 / grid.size_m**3,
            u_max,
            n_parts,
            visits,
            hits,
            touched,
            hit,
        )
        n_shots += len(chunk)
        n_misses += int(np.count_nonzero(chunk.n_returns == 0))
        n_returns += len(chunk.range_m)
        world_origin_m = np.asarray(chunk.world_origin_m, np.float64)
    returns.check_all(kinds, n_shots, n_misses, n_returns, allow_missing_misses)
    for block in range(1, n_blocks):
        visits[0] += visits[block]
        hits[0] += hits[block]
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
        hit.sum(axis=1, dtype=np.int64),
        touched.sum(axis=1, dtype=np.int64),
        u_max,
        max_pad_m2_m3,
        n_shots,
        n_misses,
        world_origin_m,
        settings,
    )


def estimate(sums: Sums, *, estimator: str = "fpl", min_shots: int = 5) -> xr.Dataset:
    """Turn sums into plant area density by every estimator.

    Parameters
    ----------
    sums : Sums
    estimator : str
        The one of `ESTIMATORS` that becomes `plant_area_density_m2_m3`.
    min_shots : int
        Voxels entered by fewer shots are unknown: NaN, not zero.

    Returns
    -------
    xarray.Dataset
        Dimensions x, y, z at the voxels' centres (local frame). `pad_<estimator>_m2_m3` for each
        estimator and `plant_area_density_m2_m3`, capped; `standard_error_m2_m3` of `fpl`;
        `n_shots`, `n_hits`, `path_length_m` (sum of potential paths), `mean_zenith_deg` (between
        beams and the vertical, 0 to 90), `entering`, `intercepted` (beam shares, or sections
        [m²]), and `flag`: 1 not reached by any shot, 2 fewer than `min_shots`, 4 capped.

    Raises
    ------
    InputError
        The estimator is not known, or its sums were not asked for.
    """
    if estimator not in ESTIMATORS:
        raise InputError(
            "voxels.estimator", f"`{estimator}`", f"one of {', '.join(ESTIMATORS)}", "Choose one."
        )
    visits, hits = sums.visits, sums.hits
    n_shots, weight = visits[:, traversal.N_SHOTS], hits[:, traversal.HIT_MOMENTS]
    entering = visits[:, traversal.VISIT_MOMENTS]
    pad = _densities(sums)
    if estimator not in pad:
        raise InputError(
            "voxels.estimator",
            "`contact_frequency` with `contact_voxel_m: 0`",
            "a size of sub-voxels",
            "Set contact_voxel_m, for example to 0.05.",
        )
    error = pad.pop("standard_error")
    unknown = n_shots < min_shots
    capped = ~unknown & (pad[estimator] >= sums.max_pad_m2_m3)
    flag = (
        NOT_REACHED * (n_shots == 0) + TOO_FEW_SHOTS * (unknown & (n_shots > 0)) + CAPPED * capped
    )
    for name, values in pad.items():
        pad[name] = np.where(unknown, np.nan, np.minimum(values, sums.max_pad_m2_m3))
    with np.errstate(invalid="ignore"):
        zenith = np.degrees(visits[:, traversal.ANGLE] / n_shots)
    variables = {
        "plant_area_density_m2_m3": (pad[estimator], f"plant area density ({estimator})"),
        **{f"pad_{k}_m2_m3": (v, f"plant area density ({k})") for k, v in pad.items()},
        "standard_error_m2_m3": (
            np.where(unknown, np.nan, error),
            "standard error of pad_fpl_m2_m3 from the finite number of beams",
        ),
        "path_length_m": (visits[:, traversal.PATH], "sum of potential path lengths"),
        "mean_zenith_deg": (zenith, "mean angle between beams and the vertical"),
        "n_shots": (n_shots.astype(np.int32), "number of shots that entered"),
        "n_hits": (hits[:, traversal.N_HITS].astype(np.int32), "number of leaf hits"),
        "entering": (entering, "sum of the shares (sections) of beams that entered"),
        "intercepted": (weight, "sum of the shares (sections) of beams that leaves intercepted"),
        "flag": (flag.astype(np.uint8), "1 not reached, 2 too few shots, 4 capped"),
    }
    return _dataset(sums, variables, estimator, min_shots)


def _densities(sums: Sums) -> dict[str, np.ndarray]:
    """PAD of every voxel by every estimator, and the standard error."""
    visits, hits, cap = sums.visits, sums.hits, sums.max_pad_m2_m3
    n_shots, free = visits[:, traversal.N_SHOTS], visits[:, traversal.FREE]
    all_moments = visits[:, traversal.VISIT_MOMENTS :]
    hit_moments = hits[:, traversal.HIT_MOMENTS :]
    entering, weight = all_moments[:, 0], hit_moments[:, 0]
    corrected, biased, error = estimators.free_path(
        weight, hits[:, traversal.HIT_FREE], free, entering, n_shots
    )
    pad = {name: np.zeros(len(weight)) for name in ("transmittance", "ppl")}
    met = np.flatnonzero(weight > 0)
    u, all_weight = estimators.path_nodes(all_moments[met], sums.u_max)
    pad["transmittance"][met] = estimators.transmittance(
        u, all_weight, weight[met], entering[met], cap
    )
    u, hit_weight = estimators.path_nodes(hit_moments[met], sums.u_max)
    # Σ b·u of what passes: everything less the hits, from the first two moments.
    passing = all_moments[met, :2].sum(axis=1) - hit_moments[met, :2].sum(axis=1)
    pad["ppl"][met] = estimators.potential_path(
        u, hit_weight, weight[met], np.maximum(0.5 * sums.u_max * passing, 0.0), cap
    )
    pad |= {"fpl": corrected, "fpl_biased": biased}
    if (part_m := sums.settings["contact_voxel_m"]) > 0:
        with np.errstate(invalid="ignore"):
            factor = visits[:, traversal.PART_FACTOR] / visits[:, traversal.PARTS]
        pad["contact_frequency"] = estimators.contact_frequency(
            sums.n_hit_parts, sums.n_touched_parts, factor, part_m
        )
    return pad | {"standard_error": error}


def _dataset(sums: Sums, variables: dict, estimator: str, min_shots: int) -> xr.Dataset:
    """Give values their shape, units and the settings that made them."""
    units = {"m2_m3": "m2 m-3", "m": "m", "deg": "degree"}
    data = {
        name: (
            ("x", "y", "z"),
            values.reshape(sums.grid.shape),
            {
                "long_name": text,
                "units": next((u for end, u in units.items() if name.endswith(f"_{end}")), "1"),
            },
        )
        for name, (values, text) in variables.items()
    }
    dataset = xr.Dataset(data, coords=sums.grid.centres_m)
    for axis in "xyz":
        dataset[axis].attrs = {"long_name": f"{axis} of voxel centres, local frame", "units": "m"}
    dataset["flag"].attrs |= {
        "flag_masks": np.array([NOT_REACHED, TOO_FEW_SHOTS, CAPPED], np.uint8),
        "flag_meanings": "not_reached too_few_shots capped",
    }
    dataset.attrs = {
        "voxel_size_m": sums.grid.size_m,
        "corner_m": np.asarray(sums.grid.corner_m, np.float64),
        "origin_m": sums.world_origin_m,
        "estimator": estimator,
        "min_shots": min_shots,
        "total_shots": sums.n_shots,
        "total_misses": sums.n_misses,
        **sums.settings,
    }
    return dataset


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


def _largest_projection(distribution: str) -> float:
    return float(leaf_angles.projection(distribution, np.linspace(0, np.pi / 2, 1801)).max())
