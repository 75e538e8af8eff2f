"""Compiled march of shots through a grid of voxels (Amanatides and Woo 1987), adding up sums."""

import math

import numpy as np
from numba import njit, prange

HIT, WOOD, NOISE = 0, 1, 2
"""What an echo is: a leaf hit; wood; noise. Only the first is a hit, all weaken the beam."""

N_SHOTS, PATH, ANGLE, FREE, SUB_VISITS, SUB_PATH, VISIT_MOMENTS = range(7)
"""Columns of the sums of everything that enters a voxel, the moments last."""

N_HITS, HIT_FREE, HIT_MOMENTS = range(3)
"""Columns of the sums of leaf hits, the moments last."""

_SEGMENT = 2048


@njit(cache=True)
def _clip(origin, direction, corner, shape, size):
    """Distances at which a ray enters and leaves the grid; none where the first is larger."""
    near, far = 0.0, math.inf
    for k in range(3):
        low, high = corner[k], corner[k] + shape[k] * size
        if direction[k] == 0.0:
            if origin[k] < low or origin[k] >= high:
                return 1.0, 0.0
        else:
            a, b = (low - origin[k]) / direction[k], (high - origin[k]) / direction[k]
            near, far = max(near, min(a, b)), min(far, max(a, b))
    return near, far


@njit(cache=True)
def _next_facet(origin, inverse, corner, size, index, k):
    """Distance at which the ray leaves the slab `index` of axis k.

    From the facet's own coordinate, so that rounding does not add up along the ray.
    """
    if inverse[k] == math.inf:
        return math.inf
    facet = index + 1 if inverse[k] > 0.0 else index
    return (corner[k] + facet * size - origin[k]) * inverse[k]


@njit(cache=True)
def _start(origin, direction, corner, shape, size, distance, inverse, index, facet):
    """Set up the march at a distance along the ray."""
    for k in range(3):
        inverse[k] = 1.0 / direction[k] if direction[k] != 0.0 else math.inf
        place = math.floor((origin[k] + direction[k] * distance - corner[k]) / size)
        index[k] = min(max(int(place), 0), shape[k] - 1)
        facet[k] = _next_facet(origin, inverse, corner, size, index[k], k)


@njit(cache=True)
def _nearest(facet):
    k = 0 if facet[0] <= facet[1] else 1
    return k if facet[k] <= facet[2] else 2


@njit(cache=True)
def _add_moments(row, at, weight, t):
    for j in range(at, len(row)):
        row[j] += weight
        weight *= t


@njit(cache=True)
def _effective(length, lambda_1):
    """Effective path of a medium of finite elements (Pimont et al. 2018)."""
    return length if lambda_1 == 0.0 else -math.log(1.0 - lambda_1 * length) / lambda_1


@njit(cache=True)
def _visit_parts(
    origin, direction, corner, size, n_parts, enter, stop, echoes, kind, touched, hit, work
):
    """Mark the parts (sub-voxels) of one voxel that a beam visits from `enter` to `stop`.

    `corner` is the voxel's own. Returns how many parts were visited and the chords' sum.
    """
    inverse, index, facet, shape = work
    shape[:] = n_parts
    part_size = size / n_parts
    _start(origin, direction, corner, shape, part_size, enter, inverse, index, facet)
    distance, visits, path, j, part = enter, 0, 0.0, 0, 0
    while True:
        k = _nearest(facet)
        leave = facet[k]
        if leave - distance > 1e-9 * size:
            part = (index[0] * n_parts + index[1]) * n_parts + index[2]
            touched[part] = 1
            visits += 1
            path += leave - distance
            while j < len(echoes) and echoes[j] < leave:
                if kind[j] == HIT:
                    hit[part] = 1
                j += 1
        distance = leave
        index[k] += 1 if inverse[k] > 0.0 else -1
        if distance >= stop or index[k] < 0 or index[k] >= n_parts:
            for rest in range(j, len(echoes)):  # rounding may put them on the voxel's far facet
                if kind[rest] == HIT:
                    hit[part] = 1
            return visits, path
        facet[k] = _next_facet(origin, inverse, corner, part_size, index[k], k)


@njit(cache=True)
def _march(
    origin, direction, zenith, g, echoes, kind, corner, shape, size, beam, lambda_1, u_max,
    n_parts, visits, hits, touched, hit, work, part_work, part_corner,
):  # fmt: skip
    """Follow one shot until it leaves the grid or its last echo has taken the rest of the beam."""
    inverse, index, facet = work
    n, j = len(echoes), 0
    share = 1.0 / n if n else 0.0
    distance, far = _clip(origin, direction, corner, shape, size)
    while j < n and echoes[j] < distance:
        j += 1
    if not distance < far or (n > 0 and j == n):
        return
    _start(origin, direction, corner, shape, size, distance, inverse, index, facet)
    while True:
        k = _nearest(facet)
        leave = facet[k]
        chord = leave - distance
        if chord > 1e-9 * size:  # a beam through an edge enters no voxel beside it
            voxel = (index[0] * shape[1] + index[1]) * shape[2] + index[2]
            section = 1.0
            if beam[0] > 0.0 or beam[1] > 0.0:
                d2 = 0.0
                for a in range(3):
                    d2 += (corner[a] + (index[a] + 0.5) * size - origin[a]) ** 2
                section = math.pi * (beam[0] * math.sqrt(d2) + 0.5 * beam[1]) ** 2
            row, first = visits[voxel], j
            entering = section * share * (n - j) if n else section
            whole, t = entering, 2.0 * g * chord / u_max - 1.0
            while j < n and echoes[j] < leave:
                free = max(echoes[j] - distance, 0.0)
                weight = section * share
                u = g * _effective(free, lambda_1)
                row[FREE] += weight * u
                if kind[j] == HIT:
                    hits[voxel, N_HITS] += 1.0
                    hits[voxel, HIT_FREE] += weight * u
                    _add_moments(hits[voxel], HIT_MOMENTS, weight, t)
                else:  # what stops it has seen no leaf so far
                    _add_moments(row, VISIT_MOMENTS, weight, 2.0 * g * free / u_max - 1.0)
                    whole -= weight
                j += 1
            passing = section * share * (n - j) if n else section
            row[N_SHOTS] += 1.0
            row[PATH] += chord
            row[ANGLE] += zenith
            row[FREE] += passing * g * _effective(chord, lambda_1)
            if whole > 1e-12 * entering:
                _add_moments(row, VISIT_MOMENTS, whole, t)
            if n_parts > 0:
                for a in range(3):
                    part_corner[a] = corner[a] + index[a] * size
                stop = echoes[n - 1] if n > 0 and j == n else leave
                number, path = _visit_parts(
                    origin, direction, part_corner, size, n_parts, distance, stop,
                    echoes[first:j], kind[first:j], touched[voxel], hit[voxel], part_work,
                )  # fmt: skip
                row[SUB_VISITS] += number
                row[SUB_PATH] += g * path
            if n > 0 and j == n:
                return
        distance = max(distance, leave)
        index[k] += 1 if inverse[k] > 0.0 else -1
        if index[k] < 0 or index[k] >= shape[k]:
            return
        facet[k] = _next_facet(origin, inverse, corner, size, index[k], k)


@njit(cache=True, parallel=True)
def accumulate(
    origin, direction, zenith, g, first, range_m, kind, corner, shape, size, beam, lambda_1,
    u_max, n_parts, visits, hits, touched, hit,
):  # fmt: skip
    """Add shots to the sums of the voxels that they cross.

    An echo belongs to the voxel between whose entry (included) and exit (not included) its range
    lies on the beam: the same distances that give the path length, so that hit and path agree.

    Parameters
    ----------
    origin, direction : (n, 3) float64
    zenith, g : (n,) float64
        Angle between beam and vertical [rad], and the leaves' projection at this angle.
    first : (n + 1,) int64
    range_m : (m,) float64
    kind : (m,) uint8
        HIT, WOOD or NOISE.
    corner : (3,) float64
    shape : (3,) int64
    size : float
    beam : (2,) float64
        tan(divergence / 2) and the diameter at exit [m]; a diameter of 0: unit beam.
    lambda_1 : float
        Attenuation by one element [m⁻¹], 0 for none.
    u_max : float
        Longest optical path G·δ in a voxel [m]; moments are of t = 2·G·δ/u_max - 1.
    n_parts : int
        Sub-voxels along an edge, for the contact frequency; 0: none.
    visits, hits : (blocks, voxels, columns) float64
        Sums, added to. Blocks take turns of shots: a fixed number of them, whatever the number of
        threads, so that sums do not depend on it.
    touched, hit : (voxels, n_parts³) uint8
        Set to 1 where a beam, or a leaf hit, was in the sub-voxel.
    """
    n_blocks, n_shots = len(visits), len(direction)
    for block in prange(n_blocks):
        work = (np.empty(3), np.empty(3, np.int64), np.empty(3))
        part_work = (np.empty(3), np.empty(3, np.int64), np.empty(3), np.empty(3, np.int64))
        part_corner = np.empty(3)
        for begin in range(block * _SEGMENT, n_shots, n_blocks * _SEGMENT):
            for i in range(begin, min(begin + _SEGMENT, n_shots)):
                a, b = first[i], first[i + 1]
                _march(
                    origin[i], direction[i], zenith[i], g[i], range_m[a:b], kind[a:b], corner,
                    shape, size, beam, lambda_1, u_max, n_parts, visits[block], hits[block],
                    touched, hit, work, part_work, part_corner,
                )  # fmt: skip
