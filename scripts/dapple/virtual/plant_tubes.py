"""Tapering tubes of triangles along branch axes."""

from dataclasses import dataclass

import numpy as np

from dapple.formats.meshes import Mesh
from dapple.virtual.plant_skeleton import Skeleton, heaviest_child, unit

_SIDES = ((0.04, 8), (0.015, 6), (0.005, 4), (0.0, 3))
"""Sides of a tube whose first radius is at least so large [m]."""


@dataclass(frozen=True)
class Axes:
    """Polylines with a radius at every point, one after another.

    Attributes
    ----------
    xyz_m : (n, 3) float64
        Points, from the base of each axis to its tip; at least two an axis [m].
    radius_m : (n,) float64
        Radius of the wood there [m].
    axis : (n,) int64
        Number of the axis, ascending.
    """

    xyz_m: np.ndarray
    radius_m: np.ndarray
    axis: np.ndarray


def of_skeleton(skeleton: Skeleton, radius_m: np.ndarray) -> Axes:
    """Follow the thickest branch at every fork; each other one starts an axis of its own there."""
    parent, n = skeleton.parent, len(skeleton.parent)
    follow = heaviest_child(parent, radius_m)
    side = np.flatnonzero((np.arange(n) > 0) & (follow[np.maximum(parent, 0)] != np.arange(n)))
    points, radii, axes = [], [], []
    for number, first in enumerate(np.r_[0, side]):
        nodes = [first]
        while (node := follow[nodes[-1]]) >= 0:
            nodes.append(node)
        xyz, radius = skeleton.xyz_m[nodes], radius_m[nodes]
        if first:  # start near the bark of the thicker branch, not at its pith
            fork, towards = skeleton.xyz_m[parent[first]], skeleton.direction(first)
            length = np.linalg.norm(xyz[0] - fork)
            inside = min(0.7 * radius_m[parent[first]], 0.5 * length)
            xyz = np.concatenate([(fork + inside * towards)[None], xyz])
            radius = np.r_[radius[0], radius]
        points.append(xyz)
        radii.append(radius)
        axes.append(np.full(len(xyz), number))
    return Axes(np.concatenate(points), np.concatenate(radii), np.concatenate(axes))


def tubes(axes: Axes) -> Mesh:
    """Wrap the axes in tubes, closed at their tips.

    Parameters
    ----------
    axes : Axes

    Returns
    -------
    Mesh
        One element for each segment between two points. A tube with few sides is as wide as
        needed for its girth to be that of the round branch, so that its area and the shade it
        casts are right.
    """
    n = len(axes.xyz_m)
    starts = np.flatnonzero(np.diff(axes.axis, prepend=-1))
    size = np.diff(np.r_[starts, n])
    thresholds, choices = (np.array(column) for column in zip(*_SIDES, strict=True))
    first_radius = axes.radius_m[starts]
    sides = np.repeat(choices[np.argmax(first_radius[:, None] >= thresholds, axis=1)], size)

    across, up = _frames(axes, starts, size)
    ring = np.r_[0, np.cumsum(sides)]
    point = np.repeat(np.arange(n), sides)
    corner = np.arange(ring[-1]) - ring[point]
    angle = 2 * np.pi * corner / sides[point]
    reach = axes.radius_m * np.pi / (sides * np.sin(np.pi / sides))
    outwards = np.cos(angle)[:, None] * across[point] + np.sin(angle)[:, None] * up[point]
    vertices = axes.xyz_m[point] + reach[point, None] * outwards

    last = np.zeros(n, bool)
    last[starts + size - 1] = True
    segment = np.cumsum(~last) - 1  # of the segment that begins at each point
    mantle = np.flatnonzero(~last[point])
    own = point[mantle]
    turned = ring[own] + (corner[mantle] + 1) % sides[own]
    above, above_turned = mantle + sides[own], turned + sides[own]
    cap = np.flatnonzero(last[point] & (corner >= 1) & (corner + 1 < sides[point]))
    faces = np.concatenate(
        [
            np.column_stack([mantle, turned, above_turned]),
            np.column_stack([mantle, above_turned, above]),
            np.column_stack([ring[point[cap]], cap, cap + 1]),
        ]
    )
    element = np.concatenate([segment[own], segment[own], segment[point[cap] - 1]])
    order = np.argsort(element, kind="stable")
    return Mesh(vertices, faces[order].astype(np.int32), element[order].astype(np.int32))


def _frames(axes: Axes, starts, size) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across the axis at every point, turning as little as possible along it."""
    n = len(axes.xyz_m)
    inner = np.diff(axes.axis) == 0
    step = np.zeros((n + 1, 3))
    step[1:n][inner] = unit(np.diff(axes.xyz_m, axis=0)[inner])
    tangent = unit(step[:-1] + step[1:] + 1e-12)
    across = np.zeros((n, 3))
    helper = np.where(np.abs(tangent[starts, :1]) < 0.8, [[1.0, 0, 0]], [[0, 1.0, 0]])
    across[starts] = unit(np.cross(tangent[starts], helper))
    for k in range(1, size.max()):
        here = starts[size > k] + k
        before = across[here - 1]
        along = (before * tangent[here]).sum(1, keepdims=True)
        across[here] = unit(before - along * tangent[here])
    return across, np.cross(tangent, across)
