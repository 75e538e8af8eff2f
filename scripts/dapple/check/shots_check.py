"""Whether shots that met nothing are known, and whether those that are recorded tell the truth."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dapple import findings
from dapple.check.cloud_facts import CloudFacts
from dapple.cloud import ordered, scan_windows, shot_sources
from dapple.cloud.selection import UP
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import clouds
from dapple.formats.cloud_raw import MISSED
from dapple.formats.ordered_scan import OrderedScan
from dapple.structure import traversal
from dapple.structure.voxels import Grid, Sums, accumulate

RECORDED, REBUILDABLE, UNKNOWN = "recorded", "rebuildable", "unknown"
LEAST_RETURNS = 15
"""A scan with fewer returns saw nothing of the tree."""
CELLS = 400_000
"""Shots of a scan that are followed."""
VOXEL_M = 0.3
LEAST_EXPECTED = 200.0
FEW = 0.65
"""Of the returns that the others let expect: a scan with fewer has lost some. Scans that see a tree
from several sides and distances differ by a quarter."""


def misses(facts: CloudFacts, settings: dict[str, Any]) -> str:
    """Whether shots without return are recorded, can be rebuilt, or are unknown."""
    recorded = any(scan.shots and scan.shots > scan.points for scan in facts.source.scans)
    if recorded or facts.source.left_out.get(MISSED):
        return RECORDED
    cloud = settings["cloud"]
    placed = facts.source.scans and all(s.position_m is not None for s in facts.source.scans)
    if cloud["shots"] == "scan_frame" or cloud["scan_positions"] or placed:
        return REBUILDABLE
    return UNKNOWN


def judge(
    facts: CloudFacts, settings: dict[str, Any], path: str | Path, positions: str | Path = ""
) -> list[Finding]:
    """Findings on the shots of a cloud; `positions` is the table of scan positions, if any."""
    found = [*needed(facts, settings, path), *one_frame(facts, settings, path)]
    found += blind(facts, path)
    state = misses(facts, settings)
    if state == RECORDED and len(facts.source.scans) > 1:
        found += clipped(facts, path, UP[settings["cloud"]["up"]])
    if state == REBUILDABLE and settings["cloud"]["shots"] != "scan_frame":
        found += frames_show(facts, settings, path, positions)
    return found


def needed(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """Plant area density needs the shots that met nothing."""
    wanted = [name for name in settings["reconstructions"] if name.startswith("voxels_")]
    state = misses(facts, settings)
    if not wanted or state != UNKNOWN:
        return
    yield findings.error(
        path,
        f"no shot that met nothing, and `reconstructions: {wanted[0]}`",
        "every shot of the scanner: plant area density has no denominator without them",
        "Export PTX or a structured E57, which keep them; or give the scanner's positions "
        "(cloud.scan_positions) or its angular frame (scan_frame), from which they are rebuilt; "
        "or leave voxels out.",
        "reconstructions: [polygons]",
    )


def one_frame(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """One angular frame belongs to one scan position."""
    scans = facts.numbers["scans"]
    if settings["cloud"]["shots"] != "scan_frame" or len(scans) < 2:
        return
    listed = ", ".join(f"{scan['number']} ({scan['points']:,} points)" for scan in scans[:8])
    yield findings.error(
        path,
        f"{len(scans)} scans (PointSourceId {listed}) and one `scan_frame`",
        "one scan position for one frame",
        "Give a table of scan positions, so that a frame is found for each, or a cloud of one "
        "scan.",
        "cloud:\n  shots: positions\n  scan_positions: positions.csv",
    )


def frames_show(
    facts: CloudFacts, settings: dict, path: str | Path, positions: str | Path
) -> Iterator[Finding]:
    """The points of every scan show the frame of its directions."""
    wanted = [name for name in settings["reconstructions"] if name.startswith("voxels_")]
    level: findings.Level = "error" if wanted else "note"
    cloud = facts.cloud
    try:
        table = shot_sources.places_of(facts.source, positions, cloud.origin_m)
        if table is None:
            return
        number = scan_windows.scan_of_point(cloud, table, path)
        for row in table.to_dict("records"):
            place = np.array([row["x_m"], row["y_m"], row["z_m"]], float)
            xyz = cloud.xyz_m[number == row["position"]] - place
            if len(xyz) >= scan_windows.LEAST_POINTS:
                scan_windows.frame_of(
                    xyz, scan_windows.tilt_of(row), f"{path}, scan {row['position']}"
                )
    except InputError as mistake:
        yield replace(findings.of(mistake), level=level)


def blind(facts: CloudFacts, path: str | Path) -> Iterator[Finding]:
    """Every scan sees something of the tree."""
    scans = facts.source.scans
    for scan in scans:
        if scan.points < LEAST_RETURNS and len(scans) > 1:
            yield findings.warning(
                path,
                f"scan {scan.number} with {scan.points} returns",
                "scans that see the tree",
                "It is left out: where it looked cannot be told from so few.",
            )


def clipped(facts: CloudFacts, path: str | Path, turn: np.ndarray) -> Iterator[Finding]:
    """Shots without return do not cross what other scans show to be dense."""
    try:
        sums = _sums_of_scans(facts, path, turn)
    except InputError:
        return  # said where the shots are read
    for number, share in shares_of_expected(sums).items():
        if share < FEW:
            yield findings.warning(
                path,
                f"scan {number} with {100 * share:.0f} % of the returns that the other scans let "
                "expect: its shots without return cross what they show to be dense",
                "shots without return where nothing stands",
                "The scan was cut to a part of what it saw, it seems, and plant area comes out too "
                "small. Export the scans whole; dapple finds the tree itself.",
            )


def _sums_of_scans(facts: CloudFacts, path: str | Path, turn: np.ndarray) -> dict[int, Sums]:
    """What a sample of the shots of every scan leaves in common voxels."""
    xyz = facts.cloud.xyz_m
    some = xyz[:: max(1, len(xyz) // 200_000)]
    bounds = np.quantile(some, [0.002, 0.998], axis=0)
    size = max(VOXEL_M, float(np.cbrt(np.prod(np.ptp(bounds, axis=0)) / 400_000)))
    grid = Grid.around(bounds, size)
    sums = {}
    for number, scan in clouds.ordered_scans(path):
        if len(scan.xyz_m) < LEAST_RETURNS:
            continue
        thin = thinned(scan, CELLS).in_metres(facts.source.units.horizontal_m, turn)
        shots, _ = ordered.shots_of_grid(thin, number, facts.cloud.origin_m, source=path)
        sums[number] = accumulate(shots, grid, contact_voxel_m=0.0, allow_missing_misses=True)
    return sums


def thinned(scan: OrderedScan, most: int) -> OrderedScan:
    """Every k-th column and row of a scan, so that at most about so many shots are left."""
    every = max(1, int(np.ceil(np.sqrt(np.prod(scan.shape) / most))))
    kept = (scan.column % every == 0) & (scan.row % every == 0)
    return OrderedScan(
        scan.xyz_m[kept],
        scan.column[kept] // every,
        scan.row[kept] // every,
        (-(-scan.shape[0] // every), -(-scan.shape[1] // every)),
        scan.rotation,
        scan.position_m,
        {name: values[kept] for name, values in scan.attributes.items()},
    )


def shares_of_expected(sums: dict[int, Sums]) -> dict[int, float]:
    """Returns of every scan over those that the other scans let expect of its own shots.

    A voxel stops as large a share of a scan's free path as it stops of the others'. Where a scan
    was cut to a tree, shots that met something in front of it have lost their return and seem to
    pass through the tree.
    """
    if len(sums) < 2:
        return {}
    hits = {k: s.hits[:, traversal.N_HITS] for k, s in sums.items()}
    free = {k: s.visits[:, traversal.FREE] for k, s in sums.items()}
    all_hits, all_free = sum(hits.values()), sum(free.values())
    shares = {}
    for number in sums:
        others = all_free - free[number]
        rate = np.divide(
            all_hits - hits[number], others, out=np.zeros_like(others), where=others > 0
        )
        expected = float((free[number] * rate).sum())
        if expected >= LEAST_EXPECTED:
            shares[number] = float(hits[number][others > 0].sum()) / expected
    return shares
