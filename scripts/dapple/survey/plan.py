"""Choose the next scan positions by the returns that they are expected to bring."""

import numpy as np
from numba import njit, prange

from dapple.errors import InputError
from dapple.survey.designs import candidates, positions


def chance_of_return(
    density_m2_m3: np.ndarray,
    positions_m: np.ndarray,
    *,
    cell_size_m: float,
    voxel_size_m: float,
    zenith_step_deg: float,
    azimuth_step_deg: float,
    projection: float = 0.5,
    views: float = 3.0,
    shown: float = 0.2,
    step_m: float = 0.25,
) -> np.ndarray:
    """Chance that a scan from each position has a return from a filled voxel amid each cell.

    Parameters
    ----------
    density_m2_m3 : (nx, ny, nz) float64
        Estimated plant area density, without gaps; the grid's corner is the origin.
    positions_m : (p, 3) float64
        Scanners [m].
    cell_size_m, voxel_size_m : float
        Edges of the density's cells and of the voxels that are to be hit [m].
    zenith_step_deg, azimuth_step_deg : float
        Of the scan.
    projection : float
        Mean projection G of a leaf.
    views : float
        Beams to one voxel that meet different leaves on their way; more of them see the same gaps.
    shown : float
        Share of the section of a filled voxel that its leaves darken: the chance that a beam which
        comes so far meets them.
    step_m : float
        Steps in which density is added up along the line of sight [m].

    Returns
    -------
    (p, nx, ny, nz) float64
    """
    if not np.isfinite(density_m2_m3).all():
        raise InputError(
            "survey.plan", "unknown densities", "a density in every cell", "Fill them first."
        )
    shape = density_m2_m3.shape
    depth = np.zeros((len(positions_m), *shape))
    _optical_depth(
        np.asarray(density_m2_m3, np.float64),
        np.asarray(positions_m, np.float64),
        cell_size_m,
        step_m,
        depth,
    )
    through = np.exp(-projection * depth)
    centre = np.stack(np.meshgrid(*((np.arange(n) + 0.5) * cell_size_m for n in shape),
                                  indexing="ij"), axis=-1)  # fmt: skip
    away = centre[None] - np.asarray(positions_m)[:, None, None, None]
    distance = np.linalg.norm(away, axis=-1)
    sine = np.maximum(np.hypot(away[..., 0], away[..., 1]) / distance, 1e-3)
    beam_sr = np.radians(zenith_step_deg) * np.radians(azimuth_step_deg) * sine
    beams = (voxel_size_m / distance) ** 2 / beam_sr
    groups = np.clip(beams, 1, views)
    beams_of_one = np.maximum(beams, 1) / groups
    of_a_view = 1 - (1 - shown) ** beams_of_one
    chance = np.minimum(beams, 1) * (1 - (1 - through * of_a_view) ** groups)
    return np.where(away[..., 2] > 0, chance, 0.0)  # beams leave upwards only


@njit(cache=True, parallel=True)
def _optical_depth(density, positions, size, step, depth):
    """Sum of density times length between every position and every cell's centre."""
    nx, ny, nz = density.shape
    for p in prange(len(positions)):
        o = positions[p]
        for i in range(nx):
            for j in range(ny):
                for k in range(nz):
                    dx = (i + 0.5) * size - o[0]
                    dy = (j + 0.5) * size - o[1]
                    dz = (k + 0.5) * size - o[2]
                    length = np.sqrt(dx * dx + dy * dy + dz * dz)
                    n = max(int(np.ceil(length / step)), 1)
                    total = 0.0
                    for s in range(n):
                        t = (s + 0.5) / n
                        x, y = int((o[0] + t * dx) / size), int((o[1] + t * dy) / size)
                        z = int((o[2] + t * dz) / size)
                        total += density[min(x, nx - 1), min(y, ny - 1), min(z, nz - 1)]
                    depth[p, i, j, k] = total * length / n


def choose(
    chance: np.ndarray, weight: np.ndarray, n: int, taken: tuple[int, ...] = ()
) -> tuple[list[int], list[float]]:
    """Choose positions one by one, each the one that lowers the expected shadow most.

    Parameters
    ----------
    chance : (p, ...) float64
        From `chance_of_return`; positions are taken to see independently of each other.
    weight : (...) float64
        How much foliage each cell is expected to hold.
    n : int
        Number of positions, those taken included.
    taken : tuple of int
        Positions that are scanned already.

    Returns
    -------
    order : list of int
        Positions, `taken` first.
    expected_rs : list of float
        Expected relative shadow after each of them.

    Raises
    ------
    InputError
        More positions are asked for than there are, or no foliage.
    """
    if not len(taken) <= n <= len(chance) or not weight.sum() > 0:
        raise InputError(
            "survey.plan_scans",
            f"{n} scans of {len(chance)} candidates, foliage {weight.sum():g}",
            "no more scans than candidates, and some foliage",
            "Take fewer scans or more candidates.",
        )
    shadowed = np.ones(chance.shape[1:])
    order: list[int] = []
    expected = []
    for turn in range(n):
        if turn < len(taken):
            best = taken[turn]
        else:
            gain = np.array([(weight * shadowed * one).sum() for one in chance])
            gain[order] = -1.0
            best = int(np.argmax(gain))
        order.append(best)
        shadowed = shadowed * (1 - chance[best])
        expected.append(float((weight * shadowed).sum() / weight.sum()))
    return order, expected


def measured_rs(hit: np.ndarray, order: list[int]) -> list[float]:
    """Relative shadow after each scan of an order.

    Parameters
    ----------
    hit : (v,) unsigned integer
        Of every filled voxel: bit p is set where position p has a return from it.
    order : list of int
        Positions.
    """
    mask, result = 0, []
    for position in order:
        mask |= 1 << position
        result.append(float(np.mean(hit & hit.dtype.type(mask) == 0)))
    return result


def orders(
    chance: np.ndarray,
    weight: np.ndarray,
    positions_m: np.ndarray,
    volume_m: tuple[float, float, float],
    n: int,
    n_random: int,
    seed: int,
) -> tuple[dict[str, list[list[int]]], list[float]]:
    """Orders in which candidates are scanned after a first scan in the centre.

    Parameters
    ----------
    chance, weight
        As in `choose`.
    positions_m : (p, 3) float64
        Candidates; those of the designs that are not among them are left out [m].
    volume_m : three floats
        Edges of the volume [m].
    n : int
        Longest order.
    n_random : int
        Orders drawn by chance.
    seed : int

    Returns
    -------
    orders : dict of str to list of orders
        `planner`, `diamond`, `corners` (one order each) and `random`.
    expected_rs : list of float
        What the planner expects.
    """
    by_design = {}
    for design in ("diamond", "corners"):
        distance = np.linalg.norm(
            np.array(positions(design, volume_m, 0.0))[:, None, :2] - positions_m[None, :, :2],
            axis=-1,
        )
        found = distance.argmin(axis=1)[distance.min(axis=1) < 1e-6]
        by_design[design] = [[int(p) for p in found[:n]]]
    centre = int(np.linalg.norm(positions_m[:, :2] - np.divide(volume_m[:2], 2), axis=1).argmin())
    order, expected = choose(chance, weight, n, (centre,))
    rng = np.random.default_rng(seed)
    others = np.setdiff1d(np.arange(len(positions_m)), [centre])
    drawn = [[centre, *map(int, rng.permutation(others)[: n - 1])] for _ in range(n_random)]
    return {"planner": [order], **by_design, "random": drawn}, expected


def places(
    density_m2_m3: np.ndarray,
    cell_size_m: float,
    scanned_m: np.ndarray,
    along: int,
    height_m: float,
    densest_m2_m3: float = 1.0,
) -> np.ndarray:
    """Places of scans that there are, then a grid of free ones at their mean height.

    Parameters
    ----------
    density_m2_m3 : (nx, ny, nz) float64
        Estimated density; the grid's corner is the origin.
    cell_size_m : float
        Edge of a cell [m].
    scanned_m : (k, 3) float64
        Positions of the scans [m].
    along : int
        Places along each edge.
    height_m : float
        Height of the places where there is no scan yet [m].
    densest_m2_m3 : float
        No scanner is put into a cell with more.

    Returns
    -------
    (k + n, 3) float64
    """
    size_m = np.array(density_m2_m3.shape) * cell_size_m
    height_m = float(scanned_m[:, 2].mean()) if len(scanned_m) else height_m
    grid_m = np.array(candidates(size_m.tolist(), height_m, along))
    index = np.clip((grid_m / cell_size_m).astype(int), 0, np.array(density_m2_m3.shape) - 1)
    free = density_m2_m3[tuple(index.T)] <= densest_m2_m3
    between = np.linalg.norm(grid_m[:, None, :2] - scanned_m[None, :, :2], axis=-1)
    apart = between.min(axis=1, initial=np.inf)
    return np.concatenate([scanned_m, grid_m[free & (apart > cell_size_m)]])
