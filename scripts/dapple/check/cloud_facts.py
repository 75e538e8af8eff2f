"""What a point cloud holds: numbers that a user can hold against what was scanned."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from dapple.cloud import ground_finder, selection, trees
from dapple.formats import ground_surface
from dapple.formats.cloud_raw import MISSED, Source
from dapple.formats.clouds import Cloud
from dapple.formats.ground_surface import GroundSurface
from dapple.structure.polygon_sizes import spacings_m

SAMPLE = 20_000
TALLEST_M = 130.0
"""No tree is higher."""
WIDEST_M = 3000.0
"""No plot is wider."""
STEPS_M = (1.0, 0.5, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""Steps that coordinates are commonly rounded to, the coarsest first."""


@dataclass(frozen=True)
class CloudFacts:
    """A cloud with what was found in it.

    Attributes
    ----------
    cloud : Cloud
        In metres, without what its file calls noise.
    source : Source
    ground : GroundSurface
    stems : pandas.DataFrame
        As of `stems.find`, local frame.
    numbers : dict
        What `check.json` holds of it.
    """

    cloud: Cloud
    source: Source
    ground: GroundSurface
    stems: pd.DataFrame
    numbers: dict[str, Any] = field(default_factory=dict)


def gather(cloud: Cloud, source: Source, *, ground_z_m: float | None) -> CloudFacts:
    """Look at a cloud once.

    Parameters
    ----------
    cloud, source
        As `selection.take` gives them.
    ground_z_m : float or None
        Height of flat ground in world coordinates, where the configuration has it [m].
    """
    surface = _ground(cloud)
    used = surface
    if ground_z_m is not None:
        used = ground_finder.find(cloud, given_z_m=ground_z_m)
    above = cloud.xyz_m[:: -(-len(cloud) // ground_finder.MOST_POINTS)]
    if not is_a_plot(cloud.xyz_m):
        above = above[:0]
    found, found_by = trees.trees_of(above, used)
    low, high = cloud.world_xyz_m.min(axis=0), cloud.world_xyz_m.max(axis=0)
    spacing, wider = spacings_m(cloud.xyz_m)
    numbers = {
        "points_in_file": source.in_file,
        "points": len(cloud),
        "left_out": dict(source.left_out),
        "low_m": low,
        "high_m": high,
        "extent_m": high - low,
        "origin_m": cloud.origin_m,
        "crs": source.crs,
        "step_m": step_m(cloud.xyz_m, source.step),
        "spacing_m": spacing,
        "fourth_neighbour_m": wider,
        "points_per_m2": density_m2(cloud.xyz_m),
        "duplicates": int(selection.duplicates(cloud.xyz_m).sum()),
        "attributes": {name: _range(values) for name, values in cloud.attributes.items()},
        "returns": _returns(cloud),
        "scanner": likely_scanner(cloud, source),
        "scans": _scans(cloud, source),
        "ground": {
            "found_by": surface.found_by,
            "z_m": _world_ground(surface, cloud),
            "slope": surface.slope,
            "configured_z_m": ground_z_m,
        },
        "height_m": float((cloud.xyz_m[:, 2] - used.height_m(cloud.xyz_m[:, :2])).max()),
        "trees_found_by": found_by,
        "stems": _world_stems(found, cloud.origin_m),
        "notes": list(source.notes),
    }
    return CloudFacts(cloud, source, used, found, numbers)


def is_a_plot(xyz_m: np.ndarray) -> bool:
    """Whether the extent is one of trees in metres: in another, stems need not be looked for."""
    extent = np.ptp(xyz_m, axis=0)
    return bool(extent[:2].max() <= WIDEST_M and extent[2] <= 10 * TALLEST_M)


def _ground(cloud: Cloud) -> GroundSurface:
    if is_a_plot(cloud.xyz_m):
        return ground_finder.find(cloud)
    return ground_surface.flat(float(cloud.xyz_m[:, 2].min()), ground_finder.LOWEST)


def density_m2(xyz_m: np.ndarray) -> float:
    """Points on a square metre of ground, median over those that have any."""
    cell = np.floor(xyz_m[:, :2]).astype(np.int64)
    cell -= cell.min(axis=0)
    _, counts = np.unique(cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1], return_counts=True)
    return float(np.median(counts))


def step_m(xyz_m: np.ndarray, stated: float | None) -> float:
    """Step to which coordinates are rounded: as stated, or coarser where the points show it [m]."""
    some = xyz_m[:: max(1, len(xyz_m) // SAMPLE), :2]
    for step in STEPS_M:
        if stated is not None and step <= stated:
            break
        rest = some / step
        if np.abs(rest - np.rint(rest)).max(initial=0.0) < 1e-3 and len(np.unique(some)) > 1:
            return step
    return 0.0 if stated is None else float(stated)


def likely_scanner(cloud: Cloud, source: Source) -> str:
    """What kind of scanner the attributes and the geometry speak for."""
    names = set(cloud.attributes)
    if source.left_out.get(MISSED) and not source.scans:
        return "shots told one by one: a ray cloud, or a table of shots"
    several = int(cloud.attributes.get("NumberOfReturns", np.ones(1)).max()) > 1
    if {"Reflectance", "Deviation"} <= names:
        return "RIEGL (reflectance and deviation)"
    if "Reflectance" in names:
        return "RIEGL, or another with calibrated reflectance"
    if several and "GpsTime" in names and _seen_from_above(cloud):
        return "airborne (several returns, seen from above)"
    if any(scan.shots for scan in source.scans):
        return "terrestrial, one scan or several in fixed places"
    return "terrestrial with several returns" if several else "unknown"


def _seen_from_above(cloud: Cloud) -> bool:
    """More points in the upper half of the heights than a terrestrial scan has."""
    z = cloud.xyz_m[:, 2]
    low, high = np.quantile(z, [0.01, 0.99])
    return bool((z > 0.5 * (low + high)).mean() > 0.4)


def _range(values: np.ndarray) -> dict[str, float]:
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    low, high = (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)
    middle = float(np.median(known[:: max(1, len(known) // 100_000)])) if len(known) else np.nan
    return {"least": low, "median": middle, "most": high, "missing": len(values) - len(known)}


def _returns(cloud: Cloud) -> dict[str, float]:
    number = cloud.attributes.get("NumberOfReturns")
    if number is None:
        return {"most": 1, "share_of_several": 0.0}
    return {"most": int(number.max()), "share_of_several": float((number > 1).mean())}


def _scans(cloud: Cloud, source: Source) -> list[dict[str, Any]]:
    """One row a scan position: what the file says of it, or its points alone."""
    if source.scans:
        return [
            {
                "number": scan.number,
                "position_m": scan.position_m,
                "points": scan.points,
                "shots": scan.shots,
            }
            for scan in source.scans
        ]
    ids = cloud.attributes.get("PointSourceId")
    if ids is None:
        return []
    numbers, counts = np.unique(ids, return_counts=True)
    if len(numbers) > 1000:
        return []
    return [
        {"number": int(k), "position_m": None, "points": int(n), "shots": None}
        for k, n in zip(numbers, counts, strict=True)
    ]


def _world_ground(surface: GroundSurface, cloud: Cloud) -> float:
    """Height of the ground in the middle of the cloud, world coordinates [m]."""
    middle = np.median(cloud.xyz_m[:: max(1, len(cloud) // 100_000), :2], axis=0)
    return float(surface.height_m(middle[None, :])[0] + cloud.origin_m[2])


def _world_stems(found: pd.DataFrame, origin_m: np.ndarray) -> list[Mapping[str, float]]:
    """The stems with the names and world coordinates that the configuration takes."""
    return [
        {
            "id": int(row.id),
            "east_m": float(row.x_m + origin_m[0]),
            "north_m": float(row.y_m + origin_m[1]),
            "foot_m": float(row.z_m + origin_m[2]),
            "width_m": float(row.width_m),
            "height_m": float(row.height_m),
        }
        for row in found.itertuples()
    ]
