"""Plant area of parts of crowns from the path lengths of pulses in them, and from intensity."""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from dapple.errors import InputError
from dapple.structure.estimators import transmittance

N_NODES = 96
"""Path lengths that stand for all; a path between two is shared between them."""

N_SHARES = 8
"""Pulses are summed in so many groups, each in order: the same sums on any number of threads."""

MOST_FOR_LONGEST = 100_000
"""Pulses that are asked for the longest path."""

TOLERANCE = 2.0
"""Voxels by which a return may lie above the stretch that it ends."""

FEWEST_PATHS = 5
"""A part that fewer pulses entered is unknown."""


@dataclass(frozen=True)
class PathLengths:
    """What pulses met in every part.

    Attributes
    ----------
    length_m : (k,) float64
        Nodes of path length [m].
    weight : (p, k) float64
        Light that entered the part on paths of these lengths [pulses].
    entered, stopped : (p,) float64
        Light that entered, and that returns in the part stopped [pulses].
    n_paths : (p,) int64
        Number of paths.
    """

    length_m: np.ndarray
    weight: np.ndarray
    entered: np.ndarray
    stopped: np.ndarray
    n_paths: np.ndarray


@dataclass(frozen=True)
class PartGrid:
    """Cubic voxels that say which part fills them.

    Attributes
    ----------
    part : (nx, ny, nz) int32
        Number of the part, -1 where there is none.
    corner_m : (3,) float64
        Lowest corner, local frame [m].
    size_m : float
        Edge of a voxel [m].
    """

    part: np.ndarray
    corner_m: np.ndarray
    size_m: float

    def at(self, xyz_m: np.ndarray) -> np.ndarray:
        """(n,) part whose voxel holds each point, -1 outside of all."""
        index = np.floor((xyz_m - self.corner_m) / self.size_m).astype(np.int64)
        inside = ((index >= 0) & (index < self.part.shape)).all(axis=1)
        part = np.full(len(xyz_m), -1)
        part[inside] = self.part[tuple(index[inside].T)]
        return part


def trace(
    grid: PartGrid,
    n_parts: int,
    start_m: np.ndarray,
    direction: np.ndarray,
    first: np.ndarray,
    distance_m: np.ndarray,
    share: np.ndarray,
    return_part: np.ndarray,
) -> PathLengths:
    """Follow every pulse through the parts, from above the crowns down to the ground.

    Parameters
    ----------
    grid : PartGrid
    n_parts : int
    start_m, direction : (n, 3) float64
        A point on each pulse (its first return) and its unit direction [m].
    first : (n + 1,) int64
        Returns of pulse i are `first[i]` to `first[i + 1] - 1`.
    distance_m : (m,) float64
        Of each return from its pulse's `start_m`, along the direction, ascending [m].
    share : (m,) float64
        Share of the pulse's light that the return stopped; they add up to 1.
    return_part : (m,) int
        Part that the return belongs to, -1: none (ground, or canopy outside of crowns).

    Returns
    -------
    PathLengths
        Each stretch of a pulse inside one part is a path of its own. It carries the light that no
        earlier return stopped.
    """
    # Some pulses tell how far nodes have to reach; a longer path is extrapolated from the last two.
    some = slice(None, None, 1 + len(start_m) // MOST_FOR_LONGEST)
    longest = _longest(grid.part, grid.corner_m, grid.size_m, start_m[some], direction[some])
    length = np.linspace(0.0, max(longest, grid.size_m), N_NODES)
    sums = _trace(
        grid.part,
        grid.corner_m,
        grid.size_m,
        n_parts,
        start_m,
        direction,
        first,
        distance_m,
        share,
        return_part,
        length[1],
    )
    inside = return_part >= 0
    stopped = np.bincount(return_part[inside], share[inside], n_parts)
    weight, n_paths = sums[0].sum(axis=0), sums[1].sum(axis=0)
    return PathLengths(length, weight, weight.sum(axis=1), stopped, n_paths)


def plant_area_density(paths: PathLengths, *, projection: float, max_density_m2_m3: float):
    """Plant area density of every part from the distribution of path lengths in it.

    Parameters
    ----------
    paths : PathLengths
    projection : float
        G, area across the beam per one-sided plant area: 0.5 for spherical angles.
    max_density_m2_m3 : float
        The estimate where (nearly) nothing passes [m² m⁻³].

    Returns
    -------
    (p,) float64
        [m² m⁻³]; NaN where fewer than `FEWEST_PATHS` pulses entered.

    Raises
    ------
    InputError
        G is not between 0 and 1.

    Notes
    -----
    Through a part of even density a path of length l is free with probability exp(-G·a·l)
    (Nilson 1971). Paths in a crown differ in length, and the mean over them is not that of the
    mean length: solved is

        Σ w(l)·exp(-G·a·l) = Σ w(l) - Σ stopped

    with w(l), the light that enters on paths of length l, in place of the path length distribution
    p(l) of Hu et al. (2014), IEEE TGRS 52, 4 and, for laser scans with intensity, of Gao et al.
    (2023). Here no crown shape is assumed: the alpha shape gives each pulse's path. The right side
    comes from intensity: what share of a pulse's returned light came from the part and from below.

    Where few pulses enter, ln of the share that passes is biased and may have no bound: half a
    pulse is added to what passes and to what enters (Haldane's correction).

    Assumed are: density even within a part and plants placed by chance in it; shares of intensity
    are shares of light (ground and canopy by their ratio, leaves' own tilt averages out over
    pulses); each pulse reached something that returned it. Clumping between parts, layers and
    crowns is solved by construction. Clumping within (needles in shoots, shoots along branches) is
    not: the result is then an effective plant area, less than the true one.
    """
    if not 0 < projection <= 1:
        raise InputError("projection", f"{projection}", "0 to 1", "Take 0.5, spherical angles.")
    passed = np.maximum(paths.entered - paths.stopped, 0.0)
    # The logarithm of a share of few pulses is biased, and without bounds where none passes.
    stopped = paths.entered * (1 - (passed + 0.5) / (paths.entered + 0.5))
    density = transmittance(
        paths.length_m * projection, paths.weight, stopped, paths.entered, max_density_m2_m3
    )
    return np.where(paths.n_paths >= FEWEST_PATHS, density, np.nan)


@njit(cache=True)
def _limits(corner, size, shape, start, direction):
    """Way along a line to where it enters and leaves the grid; the first is larger if it misses."""
    t_in, t_out = -1e30, 1e30
    for axis in range(3):
        low, high = corner[axis], corner[axis] + size * shape[axis]
        if direction[axis] == 0.0:
            if start[axis] < low or start[axis] >= high:
                return 1.0, -1.0
            continue
        a, b = (low - start[axis]) / direction[axis], (high - start[axis]) / direction[axis]
        t_in, t_out = max(t_in, min(a, b)), min(t_out, max(a, b))
    return t_in, t_out


@njit(cache=True)
def _walk(part, corner, size, start, direction, runs_part, runs_in, runs_out):
    """Stretches of a line inside of parts; returns how many."""
    t_in, t_out = _limits(corner, size, part.shape, start, direction)
    if t_in >= t_out:
        return 0
    index, step = np.empty(3, np.int64), np.empty(3, np.int64)
    t_next, t_step = np.empty(3), np.empty(3)
    for axis in range(3):
        at = (start[axis] + t_in * direction[axis] - corner[axis]) / size
        index[axis] = min(
            max(int(np.floor(at + 1e-9 * np.sign(direction[axis]))), 0), part.shape[axis] - 1
        )
        if direction[axis] == 0.0:
            step[axis], t_next[axis], t_step[axis] = 0, 1e30, 1e30
            continue
        step[axis] = 1 if direction[axis] > 0 else -1
        edge = corner[axis] + size * (index[axis] + (1 if step[axis] > 0 else 0))
        t_next[axis] = (edge - start[axis]) / direction[axis]
        t_step[axis] = size / abs(direction[axis])
    t, current, n = t_in, -1, 0
    while True:
        here = part[index[0], index[1], index[2]]
        axis = 0
        if t_next[1] < t_next[axis]:
            axis = 1
        if t_next[2] < t_next[axis]:
            axis = 2
        t_leave = min(t_next[axis], t_out)
        if here >= 0:
            if here != current:
                if n == len(runs_part):
                    return n
                runs_part[n], runs_in[n] = here, t
                n += 1
            runs_out[n - 1] = t_leave
        current, t = here, t_leave
        index[axis] += step[axis]
        if t >= t_out or index[axis] < 0 or index[axis] >= part.shape[axis]:
            return n
        t_next[axis] += t_step[axis]


@njit(cache=True)
def _scratch():
    """Room for the stretches of one line: their parts, and where they begin and end."""
    return np.empty(256, np.int64), np.empty(256), np.empty(256)


@njit(cache=True, parallel=True)
def _longest(part, corner, size, start, direction):
    """Longest stretch of any line inside one part."""
    n = len(start)
    result = np.zeros(N_SHARES)
    for group in prange(N_SHARES):
        runs_part, runs_in, runs_out = _scratch()
        for i in range(n * group // N_SHARES, n * (group + 1) // N_SHARES):
            line = start[i], direction[i]
            runs = _walk(part, corner, size, *line, runs_part, runs_in, runs_out)
            for k in range(runs):
                result[group] = max(result[group], runs_out[k] - runs_in[k])
    return result.max()


@njit(cache=True, parallel=True)
def _trace(
    part, corner, size, n_parts, start, direction, first, distance, share, return_part, node_m
):
    """Light entering each part by path length, and number of paths, of each group of pulses."""
    n = len(start)
    weight = np.zeros((N_SHARES, n_parts, N_NODES))
    count = np.zeros((N_SHARES, n_parts), np.int64)
    for group in prange(N_SHARES):
        runs_part, runs_in, runs_out = _scratch()
        for i in range(n * group // N_SHARES, n * (group + 1) // N_SHARES):
            line = start[i], direction[i]
            runs = _walk(part, corner, size, *line, runs_part, runs_in, runs_out)
            light, at = 1.0, first[i]
            for k in range(runs):
                while at < first[i + 1] and distance[at] < runs_in[k]:
                    near = distance[at] >= runs_in[k] - TOLERANCE * size
                    if near and return_part[at] == runs_part[k]:
                        break  # of this part's own skin, which voxels do not follow exactly
                    light -= share[at]
                    at += 1
                if light <= 1e-9:
                    break
                place = (runs_out[k] - runs_in[k]) / node_m
                low = min(int(place), N_NODES - 2)
                weight[group, runs_part[k], low] += light * (low + 1 - place)
                weight[group, runs_part[k], low + 1] += light * (place - low)
                count[group, runs_part[k]] += 1
    return weight, count
