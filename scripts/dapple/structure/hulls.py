"""Compiled parts of the polygon reconstruction: planes, convex hulls, buffers, random turns."""

import math

import numpy as np
from numba import njit, prange

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)

FLAT = 1e-6
"""Points this close to a line, as a fraction of the voxel size, are taken to lie on it."""


@njit(cache=True)
def _mix(z):
    """Scramble 64 bits (the finaliser of SplitMix64, Steele et al. 2014)."""
    z = z + _GOLDEN
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@njit(cache=True)
def _uniform(seed, voxel, k):
    """A number in 0..1 that depends on the seed, the voxel's index and k, on no order of work."""
    h = _mix(np.uint64(seed))
    for axis in range(3):
        h = _mix(h ^ np.uint64(voxel[axis]))
    return (_mix(h ^ np.uint64(k)) >> _S11) * (1.0 / 9007199254740992.0)


@njit(cache=True)
def _principal_axes(a, axes):
    """Rotate the symmetric 3 × 3 matrix `a` to its principal axes (cyclic Jacobi).

    Eigenvalues end up on the diagonal of `a`, eigenvectors in the columns of `axes`.
    """
    for i in range(3):
        for j in range(3):
            axes[i, j] = 1.0 if i == j else 0.0
    size = a[0, 0] + a[1, 1] + a[2, 2]
    for _ in range(12):
        if abs(a[0, 1]) + abs(a[0, 2]) + abs(a[1, 2]) <= 1e-18 * size:
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if a[p, q] == 0.0:
                    continue
                ratio = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
                t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    x, y = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = axes[k, p], axes[k, q]
                    axes[k, p], axes[k, q] = c * x - s * y, s * x + c * y


@njit(cache=True)
def _plane(points, mean, first, second):
    """Find the mean and the two axes of largest spread; return both spreads (r.m.s.) [m]."""
    n = len(points)
    mean[:] = 0.0
    for i in range(n):
        for j in range(3):
            mean[j] += points[i, j] / n
    a, axes = np.zeros((3, 3)), np.empty((3, 3))
    for i in range(n):
        for j in range(3):
            for k in range(j, 3):
                a[j, k] += (points[i, j] - mean[j]) * (points[i, k] - mean[k])
    a[1, 0], a[2, 0], a[2, 1] = a[0, 1], a[0, 2], a[1, 2]
    _principal_axes(a, axes)
    large = 0
    for j in range(1, 3):
        if a[j, j] > a[large, large]:
            large = j
    middle, small = (large + 1) % 3, (large + 2) % 3
    if a[small, small] > a[middle, middle]:
        middle, small = small, middle
    for j in range(3):
        first[j], second[j] = axes[j, large], axes[j, middle]
    if first[0] * second[1] < first[1] * second[0]:  # the normal shall not point downwards
        second[:] = -second
    return math.sqrt(max(a[large, large], 0.0) / n), math.sqrt(max(a[middle, middle], 0.0) / n)


@njit(cache=True)
def _turned_axes(along, turn, first, second):
    """Make `first` the unit vector `along` and `second` a perpendicular, turned about it."""
    k = 0
    for j in range(1, 3):
        if abs(along[j]) < abs(along[k]):
            k = j
    helper = np.zeros(3)
    helper[k] = 1.0
    a = np.cross(along, helper)
    a /= math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    b = np.cross(along, a)
    first[:] = along
    second[:] = math.cos(turn) * a + math.sin(turn) * b


@njit(cache=True)
def _sort_by_u_then_v(u, v, order):
    """Shell sort: in place, quick for the handful of points of a voxel, safe for thousands."""
    n = len(order)
    for gap in (3905, 1750, 701, 301, 132, 57, 23, 10, 4, 1):
        for i in range(gap, n):
            item, j = order[i], i
            while j >= gap:
                other = order[j - gap]
                if u[other] < u[item] or (u[other] == u[item] and v[other] <= v[item]):
                    break
                order[j] = other
                j -= gap
            order[j] = item


@njit(cache=True)
def _convex_hull(u, v, order, hull, tolerance):
    """Andrew's monotone chain (1979); returns the number of corners, counter-clockwise."""
    n = len(u)
    for i in range(n):
        order[i] = i
    _sort_by_u_then_v(u, v, order)
    count, floor = 0, 1
    for step in range(2 * n - 1):  # the lower chain from left to right, then the upper one back
        i = order[step] if step < n else order[2 * n - 2 - step]
        while count > floor:
            a, b = hull[count - 2], hull[count - 1]
            if (u[b] - u[a]) * (v[i] - v[a]) - (v[b] - v[a]) * (u[i] - u[a]) > tolerance:
                break
            count -= 1
        hull[count] = i
        count += 1
        if step == n - 1:
            floor = count
    return count - 1


@njit(cache=True)
def _buffer(u, v, hull, corners, buffer, mitre_limit, out):
    """Move the edges of a convex hull outwards in parallel; returns the number of vertices.

    `out` (2 × corners, 2) takes them, counter-clockwise. A corner whose mitre would be longer
    than `mitre_limit` × buffer is cut off there, at right angles to its bisector.
    """
    count = 0
    for i in range(corners):
        p, c, q = hull[(i - 1) % corners], hull[i], hull[(i + 1) % corners]
        x1, y1, x2, y2 = u[c] - u[p], v[c] - v[p], u[q] - u[c], v[q] - v[c]
        s1, s2 = math.sqrt(x1 * x1 + y1 * y1), math.sqrt(x2 * x2 + y2 * y2)
        x1, y1, x2, y2 = x1 / s1, y1 / s1, x2 / s2, y2 / s2
        cosine = x1 * x2 + y1 * y2
        half = math.sqrt(max(0.0, 0.5 * (1.0 + cosine)))
        if half * mitre_limit >= 1.0 - 1e-9:
            scale = buffer / (1.0 + cosine)
            out[count, 0] = u[c] + scale * (y1 + y2)
            out[count, 1] = v[c] - scale * (x1 + x2)
            count += 1
            continue
        sine = math.sqrt(0.5 * (1.0 - cosine))
        mx, my = (x1 - x2) / (2.0 * sine), (y1 - y2) / (2.0 * sine)  # the bisector, outwards
        side = buffer * (1.0 - mitre_limit * half) / sine
        for sign in (-1.0, 1.0):
            out[count, 0] = u[c] + mitre_limit * buffer * mx - sign * side * my
            out[count, 1] = v[c] + mitre_limit * buffer * my + sign * side * mx
            count += 1
    return count


@njit(cache=True)
def _hexagon(radius, out):
    for i in range(6):
        angle = math.pi / 3.0 * i
        out[i, 0], out[i, 1] = radius * math.cos(angle), radius * math.sin(angle)
    return 6


@njit(cache=True)
def _outline(points, voxel, size, buffer, mitre_limit, seed, u, v, order, hull, flat, out):
    """Write the polygon of one voxel to `out`; returns its number of vertices."""
    n = len(points)
    mean, first, second = np.empty(3), np.empty(3), np.empty(3)
    wide, narrow = _plane(points, mean, first, second)
    if n < 3 or wide <= FLAT * size or (narrow <= FLAT * size and buffer == 0.0):
        z = 2.0 * _uniform(seed, voxel, 0) - 1.0  # its normal is uniform on the sphere
        azimuth, r = 2.0 * math.pi * _uniform(seed, voxel, 1), math.sqrt(1.0 - z * z)
        normal = np.array([r * math.cos(azimuth), r * math.sin(azimuth), z])
        _turned_axes(normal, 2.0 * math.pi * _uniform(seed, voxel, 2), first, second)
        first[:] = np.cross(second, normal)
        count = _hexagon(size / 6.0, flat)
    else:
        if narrow <= FLAT * size:
            along = first.copy()
            _turned_axes(along, 2.0 * math.pi * _uniform(seed, voxel, 2), first, second)
        for i in range(n):
            u[i] = v[i] = 0.0
            for j in range(3):
                u[i] += (points[i, j] - mean[j]) * first[j]
                v[i] += (points[i, j] - mean[j]) * second[j]
        if narrow <= FLAT * size:
            low, high = u.min() - buffer, u.max() + buffer
            flat[0, 0] = flat[3, 0] = low
            flat[1, 0] = flat[2, 0] = high
            flat[0, 1] = flat[1, 1] = -buffer
            flat[2, 1] = flat[3, 1] = buffer
            count = 4
        else:
            corners = _convex_hull(u, v, order, hull, 1e-10 * wide * wide)
            count = _buffer(u, v, hull, corners, buffer, mitre_limit, flat)
    for i in range(count):
        for j in range(3):
            out[i, j] = mean[j] + flat[i, 0] * first[j] + flat[i, 1] * second[j]
    return count


@njit(cache=True, parallel=True)
def outlines(points, start, voxel, size, buffer, mitre_limit, seed):
    """Make the polygons of all voxels.

    Parameters
    ----------
    points : (n, 3) float64
        Points sorted by voxel [m]; those of voxel k are `start[k]:start[k + 1]`.
    start : (m + 1,) int64
    voxel : (m, 3) int64
        Index of each voxel in the grid.
    size, buffer, mitre_limit, seed
        As in `polygons.reconstruct`.

    Returns
    -------
    vertices : (c, 3) float64
        The vertices of polygon k begin at `place[k]`.
    place : (m + 1,) int64
    count : (m,) int64
        Number of vertices of each polygon.
    """
    n_voxels = len(voxel)
    place = np.zeros(n_voxels + 1, np.int64)
    for k in range(n_voxels):
        place[k + 1] = place[k] + max(6, 2 * (start[k + 1] - start[k]))
    vertices, flat = np.empty((place[-1], 3)), np.empty((place[-1], 2))
    u, v = np.empty(len(points)), np.empty(len(points))
    order, hull = np.empty(len(points), np.int64), np.empty(place[-1], np.int64)
    count = np.empty(n_voxels, np.int64)
    for k in prange(n_voxels):
        a, b, c, d = start[k], start[k + 1], place[k], place[k + 1]
        count[k] = _outline(
            points[a:b], voxel[k], size, buffer, mitre_limit, seed,
            u[a:b], v[a:b], order[a:b], hull[c:d], flat[c:d], vertices[c:d],
        )  # fmt: skip
    return vertices, place, count


@njit(cache=True, parallel=True)
def fans(vertices, place, count):
    """Pack the polygons and cut each into triangles that share its first vertex.

    Returns
    -------
    packed : (v, 3) float64
    faces : (t, 3) int32
    element : (t,) int32
    """
    n = len(count)
    corner, triangle = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)
    for k in range(n):
        corner[k + 1] = corner[k] + count[k]
        triangle[k + 1] = triangle[k] + count[k] - 2
    packed = np.empty((corner[-1], 3))
    faces, element = np.empty((triangle[-1], 3), np.int32), np.empty(triangle[-1], np.int32)
    for k in prange(n):
        packed[corner[k] : corner[k + 1]] = vertices[place[k] : place[k] + count[k]]
        for i in range(count[k] - 2):
            faces[triangle[k] + i, 0] = corner[k]
            faces[triangle[k] + i, 1] = corner[k] + i + 1
            faces[triangle[k] + i, 2] = corner[k] + i + 2
            element[triangle[k] + i] = k
    return packed, faces, element
