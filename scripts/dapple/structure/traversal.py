"""Compiled march of shots through a grid of voxels (Amanatides and Woo 1987), adding up sums."""

import math

import numpy as np
from numba import njit, prange

HIT, WOOD, NOISE = 0, 1, 2
"""What an echo is: a leaf hit; wood; noise. Only the first is a hit, all weaken the beam."""

N_SHOTS, PATH, ANGLE, FREE, PARTS, PART_FACTOR, VISIT_MOMENTS = range(7)
"""Columns of the sums of everything that enters a voxel, the moments last."""

N_HITS, HIT_FREE, HIT_MOMENTS = range(3)
"""Columns of the sums of leaf hits, the moments last."""

_SEGMENT = 2048


@njit(cache=True)
def entry_and_exit(origin, direction, corner, shape, size):
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
def next_facet(origin, inverse, corner, size, index, k):
    """Distance at which the ray leaves the slab `index` of axis k.

    From the facet's own coordinate, so that rounding does not add up along the ray.
    """
    if inverse[k] == math.inf:
        return math.inf
    facet = index + 1 if inverse[k] > 0.0 else index
    return (corner[k] + facet * size - origin[k]) * inverse[k]


@njit(cache=True)
def start_march(origin, direction, corner, shape, size, distance, inverse, index, facet):
    """Set up the march at a distance along the ray."""
    for k in range(3):
        inverse[k] = 1.0 / direction[k] if direction[k] != 0.0 else math.inf
        place = math.floor((origin[k] + direction[k] * distance - corner[k]) / size)
        index[k] = min(max(int(place), 0), shape[k] - 1)
        facet[k] = next_facet(origin, inverse, corner, size, index[k], k)


@njit(cache=True)
def nearest_facet(facet):
    """Axis of the facet that a ray meets first, of their distances along it (3,)."""
    k = 0 if facet[0] <= facet[1] else 1
    return k if facet[k] <= facet[2] else 2


@njit(cache=True)
def _add_moments(sums, voxel, at, weight, t):
    for j in range(at, sums.shape[1]):
        sums[voxel, j] += weight
        weight *= t


@njit(cache=True)
def _section(origin, corner, index, size, beam):
    """Section of the beam at a voxel's centre [m²]; 1 for a unit beam."""
    if beam[0] == 0.0 and beam[1] == 0.0:
        return 1.0
    distance = 0.0
    for k in range(3):
        distance += (corner[k] + (index[k] + 0.5) * size - origin[k]) ** 2
    return math.pi * (beam[0] * math.sqrt(distance) + 0.5 * beam[1]) ** 2


@njit(cache=True)
def _effective(length, lambda_1):
    """Path that a medium of infinitely small elements needs to dim a beam as much.

    Pimont et al. (2018): one element of area s that may lie anywhere in a voxel of volume V, and
    shows the beam G·s, leaves a path z free with the chance 1 - λ₁·z, λ₁ = G·s/V. N of them leave
    it free with (1 - λ₁·z)ᴺ = exp(-N·λ₁·z_e), z_e = -ln(1 - λ₁·z)/λ₁: over z_e the attenuation is
    N·λ₁ = G·PAD, as in a turbid medium.
    """
    return length if lambda_1 == 0.0 else -math.log(1.0 - lambda_1 * length) / lambda_1


@njit(cache=True)
def _start_parts(
    origin, direction, corner, size, n, distance, inverse, index, part, fine, step, move
):
    """Set up the march through parts (sub-voxels): `part` is the index along each axis."""
    part_size = size / n
    for k in range(3):
        low = corner[k] + index[k] * size
        place = int((origin[k] + direction[k] * distance - low) / part_size)
        part[k] = min(max(place, 0), n - 1)
        move[k] = (n * n, n, 1)[k]
        fine[k] = step[k] = math.inf
        if direction[k] != 0.0:
            facet = low + (part[k] + (1 if direction[k] > 0.0 else 0)) * part_size
            fine[k], step[k] = (facet - origin[k]) * inverse[k], abs(inverse[k]) * part_size
            move[k] = move[k] if direction[k] > 0.0 else -move[k]
    return (part[0] * n + part[1]) * n + part[2]


@njit(cache=True)
def _visit_parts(
    voxel, part, n_all, distance, leave, stop, near, fine, step, move, range_m, kind, first, last,
    touched, hit,
):  # fmt: skip
    """Mark the parts of one voxel that a beam visits from `distance` to `stop` or `leave`.

    Returns the part it is in at the end, and how many it visited.
    """
    # In registers: this loop runs several times for each voxel on the way of each beam.
    tx, ty, tz = fine[0], fine[1], fine[2]
    step_x, step_y, step_z = step[0], step[1], step[2]
    move_x, move_y, move_z = move[0], move[1], move[2]
    end, next_m = leave - near, math.inf
    if first < last:
        next_m = range_m[first]
    visits, j, word, bits = 0, first, 0, np.uint64(0)
    while True:
        # Which facet comes next is hard to foresee: choose without branches.
        on_x = (tx <= ty) & (tx <= tz)
        on_y = (not on_x) & (ty <= tz)
        facet = tx if on_x else (ty if on_y else tz)
        is_last = facet >= end
        facet = leave if is_last else facet
        own = part >> 6
        if facet - distance > near and 0 <= part < n_all:
            visits += 1
            if own != word:
                touched[voxel, word] |= bits
                word, bits = own, np.uint64(0)
            bits |= np.uint64(1) << np.uint64(part & 63)
            if next_m < facet or (is_last and first < last):
                while j < last and (range_m[j] < facet or is_last):
                    if kind[j] == HIT:
                        hit[voxel, own] |= np.uint64(1) << np.uint64(part & 63)
                    j += 1
                next_m = range_m[j] if j < last else math.inf
            distance = facet
        if is_last or distance >= stop:
            touched[voxel, word] |= bits
            fine[0], fine[1], fine[2] = tx, ty, tz
            return part, visits
        part += move_x if on_x else (move_y if on_y else move_z)
        tx += step_x if on_x else 0.0
        ty += step_y if on_y else 0.0
        tz += 0.0 if on_x | on_y else step_z


@njit(cache=True)
def _march(
    i, origin, direction, zenith, g, first, range_m, kind, corner, shape, size, beam, element,
    u_max, n_parts, has_parts, visits, hits, touched, hit, inverse, facet, fine, step, index,
    place, move,
):  # fmt: skip
    """Follow shot i until it leaves the grid or its last echo has taken the rest of the beam."""
    o, d = origin[i], direction[i]
    j, end = first[i], first[i + 1]
    is_miss = j == end
    share = 0.0 if is_miss else 1.0 / (end - j)
    distance, far = entry_and_exit(o, d, corner, shape, size)
    while j < end and range_m[j] < distance:
        j += 1
    if not distance < far or (j == end and not is_miss):
        return
    start_march(o, d, corner, shape, size, distance, inverse, index, facet)
    part, near = -1, 1e-9 * size
    while True:
        k = nearest_facet(facet)
        leave = facet[k]
        if leave - distance > near:  # a beam through an edge enters no voxel beside it
            voxel = (index[0] * shape[1] + index[1]) * shape[2] + index[2]
            chord, from_j = leave - distance, j
            section = _section(o, corner, index, size, beam)
            whole = section * (1.0 if is_miss else share * (end - j))
            t = 2.0 * g * chord / u_max - 1.0
            while j < end and range_m[j] < leave:
                free, weight = max(range_m[j] - distance, 0.0), section * share
                u = g * _effective(free, g * element)
                visits[voxel, FREE] += weight * u
                if kind[j] == HIT:
                    hits[voxel, N_HITS] += 1.0
                    hits[voxel, HIT_FREE] += weight * u
                    _add_moments(hits, voxel, HIT_MOMENTS, weight, t)
                else:  # what stops it has seen no leaf so far
                    at = 2.0 * g * free / u_max - 1.0
                    _add_moments(visits, voxel, VISIT_MOMENTS, weight, at)
                    whole -= weight
                j += 1
            is_over = j == end and not is_miss
            visits[voxel, N_SHOTS] += 1.0
            visits[voxel, PATH] += chord
            visits[voxel, ANGLE] += zenith
            if not is_over:
                passing = section * (1.0 if is_miss else share * (end - j))
                visits[voxel, FREE] += passing * g * _effective(chord, g * element)
            if whole > 1e-12 * section:
                _add_moments(visits, voxel, VISIT_MOMENTS, whole, t)
            if has_parts[voxel]:
                if part < 0:
                    part = _start_parts(
                        o, d, corner, size, n_parts, distance, inverse, index, place, fine, step,
                        move,
                    )  # fmt: skip
                stop = range_m[end - 1] if is_over else leave
                part, number = _visit_parts(
                    voxel, part, n_parts**3, distance, leave, stop, near, fine, step, move, range_m,
                    kind, from_j, j, touched, hit,
                )  # fmt: skip
                visits[voxel, PARTS] += number
                visits[voxel, PART_FACTOR] += number * math.cos(zenith) / g
            else:
                part = -1
            if is_over:
                return
        distance = max(distance, leave)
        index[k] += 1 if inverse[k] > 0.0 else -1
        if index[k] < 0 or index[k] >= shape[k]:
            return
        if part >= 0:  # from the last part of one voxel to the first of the next
            part -= (n_parts - 1) * move[k]
            fine[k] = leave + step[k]
        facet[k] = next_facet(o, inverse, corner, size, index[k], k)


@njit(cache=True, parallel=True)
def accumulate(
    origin, direction, zenith, g, first, range_m, kind, corner, shape, size, beam, element,
    u_max, n_parts, has_parts, visits, hits, touched, hit,
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
    element : float
        One-sided area of an element over a voxel's volume [m⁻¹]; 0: infinitely small elements.
    u_max : float
        Longest optical path G·δ in a voxel [m]; moments are of t = 2·G·δ/u_max - 1.
    n_parts : int
        Sub-voxels along an edge, for the contact frequency; 0: none.
    has_parts : (voxels,) bool
        Where sub-voxels are of interest: most of the way of most beams leads through empty voxels.
    visits, hits : (blocks, voxels, columns) float64
        Sums, added to. Blocks take turns of shots: a fixed number of them, whatever the number of
        threads, so that sums do not depend on it.
    touched, hit : (blocks, voxels, words) uint64
        A bit of each sub-voxel, set where a beam, or a leaf hit, was in it.
    """
    n_blocks, n_shots = len(visits), len(direction)
    for block in prange(n_blocks):
        inverse, facet, fine, step = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
        index, place, move = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
        for begin in range(block * _SEGMENT, n_shots, n_blocks * _SEGMENT):
            for i in range(begin, min(begin + _SEGMENT, n_shots)):
                _march(
                    i, origin, direction, zenith[i], g[i], first, range_m, kind, corner, shape,
                    size, beam, element, u_max, n_parts, has_parts, visits[block], hits[block],
                    touched[block], hit[block], inverse, facet, fine, step, index, place, move,
                )  # fmt: skip
