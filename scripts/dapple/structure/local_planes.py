"""The plane that the points around each point agree on, however many surfaces pass by."""

import math
from collections.abc import Iterator

import numpy as np
from numba import njit, prange
from scipy.spatial import cKDTree

TRIES = 48
"""Planes through pairs of neighbours that are tried for one point."""
REFINEMENTS = 3
"""Times that the best of them is fitted anew to the points that it agrees with."""
LEAST_SINE = 0.25
"""Neighbours seen at a smaller angle from the point say too little about a plane."""
LEAST_WIDTH = 0.02
"""Variance across points over that along them, below which they are a line."""
PIECE = 500_000
"""Points whose neighbours are held at a time: 31 of each take half a kilobyte."""


def neighbours(
    points_m: np.ndarray, most: int, reach_m: float
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """The nearest points around each point, a piece of the points at a time.

    Yields
    ------
    piece : slice
        Of the points.
    index : (p, most) int32
        Near to far; n where there are fewer.
    distance : (p, most) float32
        [m], infinite where there are fewer.
    """
    tree = cKDTree(points_m)
    for start in range(0, len(points_m), PIECE):
        piece = slice(start, start + PIECE)
        distance, index = tree.query(
            points_m[piece], most + 1, distance_upper_bound=reach_m, workers=2
        )
        yield piece, index[:, 1:].astype(np.int32), distance[:, 1:].astype(np.float32)


@njit(cache=True)
def fit_plane(q, weight, count, normal):
    """Turn `normal` across the largest spread of weighted points; whether they span a plane.

    Parameters
    ----------
    q : (m, 3) float64
        Points, of which the first `count` are looked at [m].
    weight : (m,) float64
    count : int
    normal : (3,) float64
        Changed where the points span a plane.
    """
    total, mean = 0.0, np.zeros(3)
    for j in range(count):
        total += weight[j]
        mean += weight[j] * q[j]
    mean /= total
    spread = np.zeros((3, 3))
    for j in range(count):
        for a in range(3):
            for b in range(3):
                spread[a, b] += weight[j] * (q[j, a] - mean[a]) * (q[j, b] - mean[b])
    size, axes = np.linalg.eigh(spread)
    if size[2] <= 0.0 or size[1] < LEAST_WIDTH * size[2]:
        return False
    normal[:] = axes[:, 0]
    return True


@njit(cache=True)
def _agreement(q, weight, count, normal, offset, width):
    """Sum of weights of points near a plane, and where along its normal they lie on average."""
    total, moment = 0.0, 0.0
    for j in range(count):
        away = q[j, 0] * normal[0] + q[j, 1] * normal[1] + q[j, 2] * normal[2]
        near = weight[j] * math.exp(-0.5 * ((away - offset) / width) ** 2)
        total += near
        moment += near * away
    return total, moment / max(total, 1e-300)


@njit(cache=True)
def _best_try(q, weight, count, width, best):
    """The plane through the point and two neighbours that most others agree with."""
    normal, most = np.empty(3), -1.0
    for t in range(min(TRIES, count * (count - 1) // 2)):
        a = t % count
        b = (a + 1 + (t // count) * (count // 4 + 1)) % count
        normal[:] = np.cross(q[a], q[b])
        length = math.sqrt((normal * normal).sum())
        if length <= LEAST_SINE * math.sqrt((q[a] ** 2).sum() * (q[b] ** 2).sum()):
            continue
        normal /= length
        agreed = _agreement(q, weight, count, normal, 0.0, width)[0]
        if agreed > most:
            most = agreed
            best[:] = normal
    return most


@njit(cache=True, parallel=True)
def _fit_piece(points, at, index, distance, reach, width):  # pragma: no cover (compiled)
    """As `fit`, for points `at` (p, 3) with their neighbours among `points`."""
    p, k = index.shape
    normals, offsets, support = np.zeros((p, 3)), np.zeros(p), np.zeros(p)
    for i in prange(p):
        q, weight, near = np.empty((k + 1, 3)), np.empty(k + 1), np.empty(k + 1)
        count = 0
        for j in range(k):
            if index[i, j] < len(points) and distance[i, j] < reach and distance[i, j] > 0.0:
                q[count] = points[index[i, j]] - at[i]
                weight[count] = math.exp(-2.0 * (distance[i, j] / reach) ** 2)
                count += 1
        normal, offset = np.zeros(3), 0.0
        agreed = _best_try(q, weight, count, width, normal)
        if agreed <= 0.0:
            continue
        q[count], weight[count] = 0.0, 1.0
        count += 1
        for _ in range(REFINEMENTS):
            agreed, offset = _agreement(q, weight, count, normal, offset, width)
            for j in range(count):
                away = (q[j] * normal).sum() - offset
                near[j] = weight[j] * math.exp(-0.5 * (away / width) ** 2)
            if not fit_plane(q, near, count, normal):
                break
        normals[i], support[i] = normal, agreed
        offsets[i] = _agreement(q, weight, count, normal, 0.0, width)[1]
    return normals, offsets, support


def fit(
    points_m: np.ndarray, most: int, reach_m: float, width_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The plane around each point.

    Parameters
    ----------
    points_m : (n, 3) float64
        [m]
    most : int
        Nearest points that tell of a plane.
    reach_m : float
        Neighbours farther away do not count; near ones count most [m].
    width_m : float
        Points this far from a plane agree with it by exp(-1/2) [m].

    Returns
    -------
    normal : (n, 3) float64
        Unit vectors, or zero where neighbours span no plane.
    offset : (n,) float64
        From the point to its plane along the normal [m].
    support : (n,) float64
        Sum of the weights of points that agree; 0 without a plane.
    """
    normals, offsets, support = (np.empty((len(points_m), *s)) for s in ((3,), (), ()))
    for piece, index, distance in neighbours(points_m, most, reach_m):
        normals[piece], offsets[piece], support[piece] = _fit_piece(
            points_m, points_m[piece], index, distance, reach_m, width_m
        )
    return normals, offsets, support
