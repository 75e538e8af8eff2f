"""What of a cloud is taken: in metres, without noise, and with attributes that can be kept."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from dapple import frames
from dapple.errors import EmptyCloudError, InputError
from dapple.formats.cloud_raw import KNOWN_NAMES, Source, Units
from dapple.formats.clouds import Cloud

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us-ft": 1200 / 3937}
UP = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "-z": np.diag([1.0, -1.0, -1.0]),
}
"""Rotations, by the axis of a file that points up, to east, north, up."""
NOISE_CLASSES = (7, 18)
"""ASPRS: low and high noise."""

_ODD = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
NOISE = "classified as noise"
FLAGS = {"Withheld": "withheld", "Synthetic": "synthetic"}
KEPT = {*KNOWN_NAMES, "TrueClass"}
LIMITS = {"ReturnNumber": 15, "NumberOfReturns": 15, "Classification": 255, "UserData": 255}
WHOLE = {*LIMITS, "Intensity", "PointSourceId"}
"""Attributes that LAS holds as whole numbers, up to 65,535 where LIMITS has no less."""


def take(
    cloud: Cloud, source: Source, path: str | Path, *, unit: str = "auto", up: str = "z"
) -> tuple[Cloud, Source]:
    """The points of a file that the chain works on.

    Points that the file itself calls noise, withheld or synthetic are left out. Coordinates in
    feet become metres. Attributes that mean nothing to the chain, or whose values cannot be kept,
    are left out as well: they never stop a run.

    Parameters
    ----------
    cloud : Cloud
        As read, in the units of its file.
    source : Source
        What the file says of itself.
    path : str or Path
        To name in errors.
    unit : str
        Of the coordinates, one of `UNITS`; "auto": as the file says, else metres.
    up : {"z", "y", "-z"}
        Axis of the file that points up.

    Returns
    -------
    cloud : Cloud
        In metres, x east, y north, z up.
    source : Source
        With counts and notes of what was left out and changed.

    Raises
    ------
    InputError
        Coordinates are in degrees.
    EmptyCloudError
        Nothing but noise.
    """
    if unit != "auto":
        source = replace(source, units=Units(UNITS[unit], UNITS[unit]))
    cloud, source = in_metres(cloud, source, path)
    cloud, source = turned_up(cloud, up), _scanners_turned(source, up)
    cloud, left_out = without_marked(cloud, path)
    attributes, notes = storable(cloud.attributes)
    return (
        Cloud(cloud.xyz_m, cloud.origin_m, attributes),
        replace(
            source,
            left_out={**source.left_out, **left_out},
            notes=(*source.notes, *notes),
        ),
    )


def in_metres(cloud: Cloud, source: Source, path: str | Path) -> tuple[Cloud, Source]:
    """Coordinates in metres, with a note where they were in another unit.

    Raises
    ------
    InputError
        They are in degrees: a degree of longitude is no fixed length; or geocentric: no axis is up.
    """
    units = source.units
    if units.degrees:
        low, high = cloud.world_xyz_m.min(axis=0), cloud.world_xyz_m.max(axis=0)
        raise InputError(
            path,
            f"longitudes and latitudes ({low[0]:.5f} to {high[0]:.5f}, {low[1]:.5f} to "
            f"{high[1]:.5f})",
            "a projected coordinate system in metres",
            f"Reproject the cloud, for example with `pdal translate in.laz out.laz reprojection "
            f"--filters.reprojection.out_srs=EPSG:{_utm_zone(low[0], low[1])}`.",
        )
    if units.geocentric:
        x, y, z = cloud.world_xyz_m.mean(axis=0)
        raise InputError(
            path,
            f"coordinates from the centre of the earth ({x:.0f}, {y:.0f}, {z:.0f})",
            "a projected coordinate system in metres, with heights",
            "Reproject the cloud, for example with `pdal translate in.laz out.laz reprojection "
            "--filters.reprojection.out_srs=EPSG:32632` or another UTM zone.",
        )
    factor = np.array([units.horizontal_m, units.horizontal_m, units.vertical_m])
    if (factor == 1.0).all():
        return cloud, source
    note = (
        f"Coordinates are in units of {factor[0]:.6g} m, heights of {factor[2]:.6g} m: turned into "
        "metres."
    )
    step = None if source.step is None else source.step * factor[0]
    scans = tuple(
        replace(s, position_m=None if s.position_m is None else s.position_m * factor)
        for s in source.scans
    )
    changed = Cloud(cloud.xyz_m * factor, cloud.origin_m * factor, cloud.attributes)
    return changed, replace(source, step=step, scans=scans, notes=(*source.notes, note))


def turned_up(cloud: Cloud, up: str) -> Cloud:
    """The cloud turned about x so that an axis of its world points up."""
    if up == "z":
        return cloud
    world = cloud.world_xyz_m @ UP[up].T
    origin = frames.choose_origin(world)
    return Cloud(frames.to_local(world, origin), origin, cloud.attributes)


def _scanners_turned(source: Source, up: str) -> Source:
    """What the file says of scanners, turned like its points."""
    turn = UP[up]
    scans = tuple(
        replace(
            s,
            position_m=None if s.position_m is None else turn @ s.position_m,
            rotation=None if s.rotation is None else turn @ s.rotation,
        )
        for s in source.scans
    )
    return replace(source, scans=scans)


def without_marked(cloud: Cloud, path: str | Path) -> tuple[Cloud, dict[str, int]]:
    """Without points that the file calls noise, withheld or synthetic; how many of each.

    Raises
    ------
    EmptyCloudError
        Nothing is left.
    """
    marked = {}
    if "Classification" in cloud.attributes:
        marked[NOISE] = np.isin(cloud.attributes["Classification"], NOISE_CLASSES)
    for name, reason in FLAGS.items():
        if name in cloud.attributes:
            marked[reason] = cloud.attributes[name] > 0
    if not marked:
        return cloud, {}
    dropped = np.any(list(marked.values()), axis=0)
    counts = {reason: int(mask.sum()) for reason, mask in marked.items() if mask.any()}
    if dropped.all():
        said = ", ".join(f"{n:,} {reason}" for reason, n in counts.items())
        raise EmptyCloudError(
            path,
            f"noise alone ({said})",
            "points of ground and plants",
            "Check classes and flags of the export.",
        )
    kept = cloud.select(~dropped) if dropped.any() else cloud
    attributes = {n: v for n, v in kept.attributes.items() if n not in FLAGS}
    return Cloud(kept.xyz_m, kept.origin_m, attributes), counts


def storable(attributes: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Attributes that the chain may use and LAS can hold, and notes on the others."""
    kept, notes = {}, []
    for name, values in attributes.items():
        if name not in KEPT:
            continue
        if name in WHOLE:
            limit = LIMITS.get(name, 65535)
            wrong = ~((values >= 0) & (values <= limit) & (values == np.rint(values)))
            if wrong.any():
                notes.append(
                    f"{name} is left out: {values[wrong][0]} is no whole number from 0 to {limit}."
                )
                continue
            values = values.astype(np.uint16 if limit == 65535 else np.uint8)
        kept[name] = values
    return kept, notes


def duplicates(xyz_m: np.ndarray) -> np.ndarray:
    """(n,) True for points at exactly the place of one before them."""
    return first_at_place(xyz_m) != np.arange(len(xyz_m))


def first_at_place(xyz_m: np.ndarray) -> np.ndarray:
    """(n,) int64, the first point at exactly the place of each point: itself, or one before it."""
    first = np.arange(len(xyz_m))
    # Points at one place have one key; the few with a key of another are compared in full.
    key = np.zeros(len(xyz_m), np.uint64)
    for axis, odd in enumerate(_ODD):
        key ^= (xyz_m[:, axis] + 0.0).view(np.uint64) * odd  # + 0.0: no -0.0
    ordered = np.sort(key)
    repeated = ordered[1:][ordered[1:] == ordered[:-1]]
    del ordered
    if not len(repeated):
        return first
    candidates = np.flatnonzero(
        repeated[np.searchsorted(repeated, key).clip(max=len(repeated) - 1)] == key
    )
    order = candidates[np.lexsort(xyz_m[candidates].T)]
    new = np.ones(len(order), bool)
    new[1:] = (xyz_m[order[1:]] != xyz_m[order[:-1]]).any(axis=1)
    begin = np.flatnonzero(new)
    first[order] = np.repeat(order[begin], np.diff(begin, append=len(order)))
    return first


def _utm_zone(longitude: float, latitude: float) -> int:
    zone = int((longitude + 180.0) // 6) % 60 + 1
    return (32600 if latitude >= 0 else 32700) + zone
