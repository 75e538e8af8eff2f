"""What the shots of a scan say about a place: which ended there, and which passed."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from dapple.formats.shots import Shots

U, V, KIND, WEIGHT, RANGE, COSINE = range(6)
"""Columns of evidence: where a shot meets a plane, along two axes in it [m]; whether it ended
there; the share of the beam that got there, times the cosine; range [m]; cosine of incidence."""
PASSED, HIT = 0.0, 1.0
CELL_STEPS = 2.0
"""Edge of the cells in which shots are kept by direction, in steps between shots."""
LEAST_COSINE = 0.05
"""Shots nearer to the plane say nothing about places in it."""
REACH_WIDTHS = 2.0
"""Shots farther away, in widths of the distribution by which they count, do not count."""
FAR_M = 30.0
"""Beams are looked for as wide as they are at this distance [m]."""
MIXED_REACH_M = 0.5
"""A return mixed of several targets has them within this distance."""


@dataclass(frozen=True)
class ShotIndex:
    """Shots of scans that stand still, kept by direction.

    Attributes
    ----------
    position_m : (s, 3) float64
        Of every scan.
    cell_rad : (s,) float64
        Height of the rows of cells; about as wide are these.
    row_start : (s + 1,) int64
        Rows of each scan, from the zenith down.
    cell_start : (r + 1,) int64
        Cells of each row.
    shot_start : (c + 1,) int64
        Shots of each cell.
    direction : (n, 3) float32
    return_start : (n + 1,) int64
    range_m : (m,) float32
    is_mixed : (m,) bool
        Returns of several targets, whose ranges are those of none.
    """

    position_m: np.ndarray
    cell_rad: np.ndarray
    row_start: np.ndarray
    cell_start: np.ndarray
    shot_start: np.ndarray
    direction: np.ndarray
    return_start: np.ndarray
    range_m: np.ndarray
    is_mixed: np.ndarray

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """All of it, for compiled functions."""
        return tuple(self.__dict__.values())


def build(chunks: Iterable[Shots], max_deviation: float) -> ShotIndex | None:
    """Sort shots by direction.

    Parameters
    ----------
    chunks : iterable of Shots
        The whole scan, misses included.
    max_deviation : float
        Returns at or above are mixed of several targets.

    Returns
    -------
    ShotIndex or None
        None where a scanner moves: its shots have no common centre.
    """
    positions: dict[int, np.ndarray] = {}
    parts: list[tuple[np.ndarray, ...]] = []
    for chunk in chunks:
        for scan in np.unique(chunk.scan).tolist():
            own = chunk.origin_m[chunk.scan == scan]
            place = positions.setdefault(scan, own[0])
            if np.abs(own - place).max() > 1e-3:
                return None
        parts.append(
            (
                chunk.scan,
                chunk.direction.astype(np.float32),
                chunk.n_returns.astype(np.int64),
                chunk.range_m.astype(np.float32),
                chunk.deviation >= max_deviation,
            )
        )
    if not parts:
        return None
    scan, direction, n_returns, range_m, is_mixed = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    del parts
    numbers = sorted(positions)
    cell = np.empty(len(scan), np.int64)
    cell_rad, row_start, cell_start = [], [0], [np.zeros(1, np.int64)]
    n_cells = 0
    for number in numbers:
        own = np.flatnonzero(scan == number)
        height = CELL_STEPS * _step_rad(direction[own])
        row, per_row, place = _cells(direction[own], height)
        ends = n_cells + np.cumsum(per_row)
        cell[own] = (ends - per_row)[row] + place
        n_cells = int(ends[-1])
        cell_rad.append(height)
        row_start.append(row_start[-1] + len(per_row))
        cell_start.append(ends)
    order = np.argsort(cell, kind="stable")
    first = np.concatenate([[0], np.cumsum(n_returns)])
    counts = n_returns[order]
    return_start = np.concatenate([[0], np.cumsum(counts)])
    taken = np.repeat(first[order] - return_start[:-1], counts) + np.arange(return_start[-1])
    return ShotIndex(
        np.array([positions[number] for number in numbers]),
        np.array(cell_rad),
        np.array(row_start),
        np.concatenate(cell_start),
        np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=n_cells))]),
        direction[order],
        return_start,
        range_m[taken],
        is_mixed[taken],
    )


def _step_rad(direction: np.ndarray) -> float:
    """Angle from a shot to the next one of its line, as most have it."""
    apart = np.linalg.norm(np.diff(direction[:200_000], axis=0), axis=1)
    apart = apart[apart > 0]
    return float(np.median(apart)) if len(apart) else 0.01


def _cells(direction: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Row of each shot, number of cells of every row, and place of each shot in its row."""
    n_rows = math.ceil(math.pi / height)
    middle = (np.arange(n_rows) + 0.5) * height
    per_row = np.maximum(np.ceil(2 * np.pi * np.sin(middle) / height), 1).astype(np.int64)
    zenith = np.arccos(np.clip(direction[:, 2].astype(np.float64), -1, 1))
    azimuth = np.arctan2(direction[:, 0], direction[:, 1]).astype(np.float64) % (2 * np.pi)
    row = np.minimum((zenith / height).astype(np.int64), n_rows - 1)
    place = (azimuth / (2 * np.pi) * per_row[row]).astype(np.int64)
    return row, per_row, np.minimum(place, per_row[row] - 1)


@njit(cache=True)
def _what_happened(t, cosine, tolerance, ranges, mixed):
    """Whether a shot ended at distance t or passed it, and the share of it that got there.

    Returns of one shot are taken to be equally large. -1: it is not known.
    """
    left = 1.0
    for j in range(len(ranges)):
        if mixed[j] and abs(ranges[j] - t) < MIXED_REACH_M:
            return -1.0, 0.0
        if abs(ranges[j] - t) * cosine < tolerance:
            return HIT, left
        if ranges[j] > t:
            return PASSED, left
        left -= 1.0 / len(ranges)
    return (PASSED, 1.0) if len(ranges) == 0 else (-1.0, 0.0)


@njit(cache=True)
def gather(index, centre, normal, u, v, radius, tolerance, out):
    """Evidence of all shots that meet a disc; returns how many rows of `out` were filled.

    Parameters
    ----------
    index : tuple
        `ShotIndex.arrays`.
    centre, normal, u, v : (3,) float64
        Of the disc, and two axes in it.
    radius : float
        [m]
    tolerance : float
        Returns this near to the plane are of it [m].
    out : (most, 6) float64
        Filled with the columns above; what does not fit is left out.
    """
    position, cell_rad, row_start, cell_start, shot_start = index[:5]
    direction, return_start, range_m, is_mixed = index[5:]
    made = 0
    for s in range(len(position)):
        to = centre - position[s]
        distance = math.sqrt((to * to).sum())
        if distance < 2.0 * radius:
            continue
        height, n_rows = cell_rad[s], row_start[s + 1] - row_start[s]
        around = math.asin(radius / distance)
        zenith = math.acos(to[2] / distance)
        azimuth = math.atan2(to[0], to[1]) % (2.0 * math.pi)
        sine = math.sin(zenith)
        half = math.pi if math.sin(around) >= sine else math.asin(math.sin(around) / sine)
        depth = (to * normal).sum()
        low = max(int((zenith - around) / height), 0)
        high = min(int((zenith + around) / height), n_rows - 1)
        for row in range(row_start[s] + low, row_start[s] + high + 1):
            per_row = cell_start[row + 1] - cell_start[row]
            a0 = math.floor((azimuth - half) / (2.0 * math.pi) * per_row)
            a1 = math.floor((azimuth + half) / (2.0 * math.pi) * per_row)
            if a1 - a0 >= per_row:
                a0, a1 = 0, per_row - 1
            for a in range(a0, a1 + 1):
                cell = cell_start[row] + a % per_row
                for i in range(shot_start[cell], shot_start[cell + 1]):
                    dx, dy, dz = (
                        float(direction[i, 0]),
                        float(direction[i, 1]),
                        float(direction[i, 2]),
                    )
                    cosine = dx * normal[0] + dy * normal[1] + dz * normal[2]
                    if abs(cosine) < LEAST_COSINE:
                        continue
                    t = depth / cosine
                    x, y, z = t * dx - to[0], t * dy - to[1], t * dz - to[2]
                    if t <= 0.0 or x * x + y * y + z * z > radius * radius:
                        continue
                    returns = slice(return_start[i], return_start[i + 1])
                    cosine = abs(cosine)
                    kind, left = _what_happened(
                        t, cosine, tolerance, range_m[returns], is_mixed[returns]
                    )
                    if kind < 0.0:
                        continue
                    if made == len(out):
                        return made
                    out[made, U] = x * u[0] + y * u[1] + z * u[2]
                    out[made, V] = x * v[0] + y * v[1] + z * v[2]
                    out[made, KIND], out[made, WEIGHT] = kind, left * cosine
                    out[made, RANGE], out[made, COSINE] = t, cosine
                    made += 1
    return made


@njit(cache=True)
def axes_in(normal, u, v):
    """Two unit vectors across a normal and each other."""
    u[:] = 0.0
    u[0 if abs(normal[0]) < 0.9 else 1] = 1.0
    u -= (u * normal).sum() * normal
    u /= math.sqrt((u * u).sum())
    v[:] = np.cross(normal, u)


@njit(cache=True, parallel=True)
def hit_shares(index, centre, normal, width, tolerance, beam, most=1024):
    """Share of hits among the shots around each place on its plane.

    Shots count by a normal distribution of their distance from the place. A beam ends at a target
    that its edge touches and passes only where all of it passes: passages count from the edge of
    the beam, and from once more its radius because hits reach as far beyond their target.

    Parameters
    ----------
    index : tuple
        `ShotIndex.arrays`.
    centre, normal : (n, 3) float64
    width : (n,) float64
        Standard deviation of that distribution [m].
    tolerance : float
        Returns this near to the plane are of it [m].
    beam : (2,) float64
        Radius of the beam within which a target ends it: at the exit [m], and growth per metre.
    most : int
        Shots that are looked at for one place.

    Returns
    -------
    share : (n,) float64
        NaN where no shot says anything.
    weight : (n,) float64
        Sum of the weights of shots.
    """
    share, weight = np.full(len(centre), np.nan), np.zeros(len(centre))
    for i in prange(len(centre)):
        out, u, v = np.empty((most, 6)), np.empty(3), np.empty(3)
        axes_in(normal[i], u, v)
        reach = REACH_WIDTHS * width[i] + 2.0 * (beam[0] + beam[1] * FAR_M)
        made = gather(index, centre[i], normal[i], u, v, reach, tolerance, out)
        hit, total = 0.0, 0.0
        for e in range(made):
            away = math.sqrt(out[e, U] ** 2 + out[e, V] ** 2)
            if out[e, KIND] == PASSED:
                edge = (beam[0] + beam[1] * out[e, RANGE]) / math.sqrt(out[e, COSINE])
                away = max(away - 2.0 * edge, 0.0)
            if away > REACH_WIDTHS * width[i]:
                continue
            seen = out[e, WEIGHT] * math.exp(-0.5 * (away / width[i]) ** 2)
            total += seen
            hit += seen * out[e, KIND]
        if total > 0.0:
            share[i] = hit / total
        weight[i] = total
    return share, weight
