"""Where the ground lies under a scanned tree or plot: from classes, a cloth, stem feet, or said.

Terrestrial clouds come with ground and without, level and on slopes, with heights above the sea or
above the scanner. The ground is looked for in this order, and the first that is sound is taken:
points that the file calls ground; a cloth that falls on the cloud turned upside down, where it lies
on a layer of points; the feet of stems, where the ground itself was cut away; the lowest point.
"""

import numpy as np
import pandas as pd

from dapple.cloud import ground, stems
from dapple.formats import ground_surface
from dapple.formats.clouds import Cloud
from dapple.formats.ground_surface import GroundSurface

GROUND_CLASS = 2
"""ASPRS: ground."""
LEAST_POINTS = 20
CELL_M, CLOTH_M, STEP_M = 0.2, 0.5, 0.5
THRESHOLD_M = 0.2
BELOW_M = 0.5
"""Nothing but noise lies deeper under the ground."""
MOST_BELOW = 0.002
"""Share of points that may do so."""
COVERED = 0.25
"""Share of the area with ground from which on it is a surface, and not some feet of stems."""
STEEPEST = 1.0
LEAST_SPREAD_M = 2.0
"""Feet of stems in a line, or close together, do not show which way the ground leans."""
LOWEST = "lowest point"
MARGIN_M = 15.0
"""The surface goes on so far beyond the cloud, along its mean plane: sensors and shade need it."""
MOST_NODES = 400
"""Of the surface along an edge of the cloud."""
MOST_POINTS = 5_000_000
"""A denser cloud is looked at by every k-th point."""
LONE, LONE_CELL_M = 3, 0.3
"""So few points in 27 cells around one are noise."""


def find(cloud: Cloud, *, given_z_m: float | None = None) -> GroundSurface:
    """Find the ground under a cloud.

    Parameters
    ----------
    cloud : Cloud
        Local frame, z up, noise classes already left out; `Classification` is used where it has
        ground (class 2).
    given_z_m : float or None
        Height of flat ground in the cloud's world coordinates [m]; None looks for it.

    Returns
    -------
    GroundSurface
        Local frame; `found_by` says how.
    """
    if given_z_m is not None:
        return ground_surface.flat(given_z_m - cloud.origin_m[2], "configuration")
    every = -(-len(cloud) // MOST_POINTS)
    some = cloud.select(slice(None, None, every)) if every > 1 else cloud
    classes = some.attributes.get("Classification")
    if classes is not None and (classes == GROUND_CLASS).sum() >= LEAST_POINTS:
        points = some.xyz_m[classes == GROUND_CLASS]
        return _surface(points[ground.lowest(points, cell_m=CELL_M)], some.xyz_m, "ground class")
    xyz = some.xyz_m[~ground.isolated(some.xyz_m, cell_m=LONE_CELL_M, most_points=LONE)]
    if len(xyz) < LEAST_POINTS:
        xyz = some.xyz_m
    return _by_cloth(xyz) or _by_feet(xyz) or ground_surface.flat(float(xyz[:, 2].min()), LOWEST)


def _by_cloth(xyz_m: np.ndarray) -> GroundSurface | None:
    """Ground near a cloth, or None where the cloth lies on no ground."""
    low = xyz_m[ground.lowest(xyz_m, cell_m=CELL_M)]
    base = xyz_m.min(axis=0)
    near = ground.cloth(
        low - base, cloth_m=CLOTH_M, rigidness=2, threshold_m=THRESHOLD_M, least_share=0.0
    )
    if near.sum() < LEAST_POINTS or ground.covered_share(low, near, CLOTH_M) < COVERED:
        return None
    found = _surface(low[near], xyz_m, "cloth")
    return found if _is_sound(found, xyz_m) else None


def _by_feet(xyz_m: np.ndarray) -> GroundSurface | None:
    """A plane through the feet of the stems, level under one; None where no stem shows.

    Stems are looked for above level ground at the lowest point, then above the plane of the feet
    found so far, until there are no more of them: so the plane climbs a slope.
    """
    surface, known = ground_surface.flat(float(xyz_m[:, 2].min())), 0
    for _ in range(10):
        found = stems.find(xyz_m, surface)
        if len(found) <= known:
            break
        known = len(found)
        surface = _plane(_feet(xyz_m, found), xyz_m)
    return surface if known else None


def _feet(xyz_m: np.ndarray, found: pd.DataFrame) -> np.ndarray:
    """(s, 3) the lowest point beside the axis of every stem."""
    feet = []
    for stem in found.itertuples():
        reach = 0.5 * stem.width_m + 0.15
        near = np.abs(xyz_m[:, :2] - [stem.x_m, stem.y_m]).max(axis=1) <= reach
        feet.append((stem.x_m, stem.y_m, xyz_m[near, 2].min()))
    return np.array(feet, float)


def _is_sound(surface: GroundSurface, xyz_m: np.ndarray) -> bool:
    """Nothing lies under it: where stems go on below, the cloth hangs on crowns."""
    some = xyz_m[:: max(1, len(xyz_m) // 500_000)]
    below = some[:, 2] < surface.height_m(some[:, :2]) - BELOW_M
    return bool(below.mean() <= MOST_BELOW and surface.slope <= STEEPEST)


def _surface(points_m: np.ndarray, xyz_m: np.ndarray, found_by: str) -> GroundSurface:
    """Heights on a grid: the median of the points of each cell about their mean plane."""
    plane = _fit_plane(points_m)
    extent = np.stack([xyz_m[:, :2].min(axis=0), xyz_m[:, :2].max(axis=0)])
    step = max(STEP_M, float(np.ptp(extent, axis=0).max()) / MOST_NODES)
    above = np.column_stack([points_m[:, :2], points_m[:, 2] - _at(plane, points_m[:, :2])])
    raster = ground.elevation(above, extent, pixel_m=step, crs="")
    around = round(MARGIN_M / step)
    rest = np.pad(raster.values[0][::-1].astype(np.float64), around, mode="edge")
    y, x = (
        nodes.min() + step * (np.arange(len(nodes) + 2 * around) - around)
        for nodes in raster.centres_m()
    )
    return GroundSurface(x, y, rest + _at_nodes(plane, x, y), found_by)


def _plane(feet_m: np.ndarray, xyz_m: np.ndarray) -> GroundSurface:
    """The plane of the feet; level at the lowest where they do not show which way it leans."""
    spread = np.linalg.svd(feet_m[:, :2] - feet_m[:, :2].mean(axis=0), compute_uv=False)
    said = "foot of the stem" if len(feet_m) == 1 else "feet of the stems"
    if len(feet_m) < 3 or spread[-1] < LEAST_SPREAD_M:
        return ground_surface.flat(float(feet_m[:, 2].min()), said)
    plane = _fit_plane(feet_m)
    low, high = xyz_m[:, :2].min(axis=0) - MARGIN_M, xyz_m[:, :2].max(axis=0) + MARGIN_M
    x, y = np.array([low[0], high[0]]), np.array([low[1], high[1]])
    return GroundSurface(x, y, _at_nodes(plane, x, y), said)


def _fit_plane(points_m: np.ndarray) -> np.ndarray:
    """East and north gradient and height at the origin, outliers beyond 3 deviations left out."""
    design = np.column_stack([points_m[:, :2], np.ones(len(points_m))])
    good = np.ones(len(points_m), bool)
    for _ in range(5):
        plane, *_ = np.linalg.lstsq(design[good], points_m[good, 2])
        rest = points_m[:, 2] - design @ plane
        good = np.abs(rest) <= max(3 * float(np.std(rest[good])), 0.05)
        if good.sum() < 3:
            break
    return plane


def _at(plane: np.ndarray, xy_m: np.ndarray) -> np.ndarray:
    return xy_m @ plane[:2] + plane[2]


def _at_nodes(plane: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    return plane[0] * x_m[None, :] + plane[1] * y_m[:, None] + plane[2]
