"""E57: every scan of the file, posed in the common frame."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pye57
from pye57 import libe57

from dapple.errors import InputError
from dapple.formats.cloud_raw import (
    AT_SCANNER,
    KNOWN_NAMES,
    MISSED,
    RawCloud,
    ScanFacts,
    Source,
    Units,
    attribute_name,
    joined,
)
from dapple.formats.ordered_scan import OrderedScan

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
INVALID = ("cartesianInvalidState", "sphericalInvalidState")
CELLS = ("columnIndex", "rowIndex")
NAMES = {
    "intensity": "Intensity",
    "colorRed": "Red",
    "colorGreen": "Green",
    "colorBlue": "Blue",
    "returnIndex": "ReturnNumber",
    "returnCount": "NumberOfReturns",
    "timeStamp": "GpsTime",
}
CHUNK = 500_000
MOST_CELLS = 1000
"""Of the grid of a scan for each of its records: more, and its indices mean something else."""


@dataclass(frozen=True)
class Scan:
    """The valid points of one scan in its own frame, and how many records were none.

    `cell` holds columns and rows, (n, 2), and `shape` their numbers, where the scan is ordered.
    """

    xyz_m: np.ndarray
    attributes: dict[str, np.ndarray]
    cell: np.ndarray | None
    shape: tuple[int, int] | None
    rotation: np.ndarray
    position_m: np.ndarray
    invalid: int
    at_scanner: int


def read(path: Path) -> RawCloud:
    """Valid points of all scans; `PointSourceId` counts the scans from 1."""
    pieces, facts, left_out = [], [], {MISSED: 0, AT_SCANNER: 0}
    with _opened(path) as file:
        crs = _coordinate_system(file)
        for number in range(1, file.scan_count + 1):
            scan = _scan(path, file, number)
            n = len(scan.xyz_m)
            xyz = scan.xyz_m @ scan.rotation.T + scan.position_m
            ids = {"PointSourceId": np.full(n, number, np.uint16)}
            pieces.append({"xyz": xyz, **ids, **scan.attributes})
            shots = None if scan.shape is None else scan.shape[0] * scan.shape[1]
            left_out[MISSED] += scan.invalid
            left_out[AT_SCANNER] += scan.at_scanner
            facts.append(ScanFacts(number, scan.position_m, n, shots, scan.rotation))
    attributes = joined(pieces)
    xyz = attributes.pop("xyz", np.empty((0, 3)))
    source = Source(
        len(xyz) + sum(left_out.values()),
        crs,
        Units(),
        left_out={reason: n for reason, n in left_out.items() if n},
        scans=tuple(facts),
    )
    return RawCloud(xyz, attributes=attributes, source=source)


def scans(path: Path) -> Iterator[tuple[int, OrderedScan]]:
    """Number and content of every scan that keeps the columns and rows of its shots."""
    with _opened(path) as file:
        for number in range(1, file.scan_count + 1):
            scan = _scan(path, file, number)
            if scan.shape is None or scan.cell is None:
                continue
            column, row = scan.cell.T
            yield (
                number,
                OrderedScan(
                    scan.xyz_m,
                    column,
                    row,
                    scan.shape,
                    scan.rotation,
                    scan.position_m,
                    scan.attributes,
                ),
            )


def _coordinate_system(file: pye57.E57) -> str:
    """The WKT of the file, where it names a coordinate system."""
    try:
        return str(file.root["coordinateMetadata"].value()).strip()
    except libe57.E57Exception:
        return ""


def _scan(path: Path, file: pye57.E57, number: int) -> Scan:
    try:
        return _read_scan(file, number)
    except InputError:
        raise
    # The library raises many kinds of error of its own on damaged sections.
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise InputError(
            path,
            f"scan {number} that cannot be read ({said})",
            "scans with cartesian or spherical coordinates",
            "Copy or export the file again.",
        ) from error


def _read_scan(file: pye57.E57, number: int) -> Scan:
    header = file.get_header(number - 1)
    there = list(header.point_fields)
    place = next((names for names in (CARTESIAN, SPHERICAL) if set(names) <= set(there)), None)
    if place is None:
        raise ValueError(f"fields {', '.join(there)}")
    named = {name: _our_name(name) for name in there}
    wanted = [name for name in there if named[name] or name in (*place, *INVALID, *CELLS)]
    pieces, invalid, at_scanner = [], 0, 0
    ordered = set(CELLS) <= set(there)
    bounds: list[np.ndarray] = []
    for block in _blocks(file, header, wanted):
        xyz = np.stack([block[name] for name in place], axis=1)
        good = np.isfinite(xyz).all(axis=1)
        for state in INVALID:
            if state in block:
                good &= block[state] == 0
        cell = (
            np.stack([block[name] for name in CELLS], axis=1).astype(np.int64) if ordered else None
        )
        if cell is not None and len(cell):
            bounds += [cell.min(axis=0), cell.max(axis=0)]
        invalid += int((~good).sum())
        # Many writers keep a shot that met nothing as a point at the scanner itself.
        none = good & ~xyz.any(axis=1)
        if place is SPHERICAL:
            none, xyz = good & (xyz[:, 0] == 0), _cartesian(xyz)
        at_scanner += int(none.sum())
        good &= ~none
        piece = {"xyz": xyz[good]}
        for name, ours in named.items():
            if ours:
                piece[ours] = block[name][good]
        if cell is not None:
            piece["cell"] = cell[good]
        pieces.append(piece)
    found = joined(pieces)
    xyz = found.pop("xyz", np.empty((0, 3)))
    cell = found.pop("cell", None)
    grid = _grid(header, bounds, len(xyz) + invalid + at_scanner)
    attributes = {name: _typed(name, values) for name, values in found.items()}
    if grid is not None and "NumberOfReturns" not in attributes:
        place_in_grid = (cell - grid[0]) @ [grid[1][1], 1]
        attributes |= _numbered(place_in_grid, np.linalg.norm(xyz, axis=1))
    return Scan(
        xyz,
        attributes,
        None if grid is None else cell - grid[0],
        None if grid is None else grid[1],
        header.rotation_matrix if header.has_pose() else np.eye(3),
        np.asarray(header.translation if header.has_pose() else np.zeros(3), float),
        invalid,
        at_scanner,
    )


def _blocks(file: pye57.E57, header, names: list[str]) -> Iterator[dict[str, np.ndarray]]:
    """Records of a scan, so many at a time: memory follows the file, not what it announces."""
    if not header.point_count:
        return
    size = min(CHUNK, header.point_count)
    block = {name: np.empty(size) for name in names}
    buffers = libe57.VectorSourceDestBuffer()
    for name, values in block.items():
        buffers.append(libe57.SourceDestBuffer(file.image_file, name, values, size, True, True))
    reader = header.points.reader(buffers)
    try:
        while n := reader.read():
            yield {name: values[:n].copy() for name, values in block.items()}
    finally:
        reader.close()


def _grid(
    header, bounds: list[np.ndarray], records: int
) -> tuple[np.ndarray, tuple[int, int]] | None:
    """Least column and row, and their numbers; None where the indices are no grid."""
    if not bounds:
        return None
    least, most = np.min(bounds, axis=0), np.max(bounds, axis=0)
    for k, name in enumerate(("column", "row")):
        try:
            said = [header.indexBounds[f"{name}{end}"].value() for end in ("Minimum", "Maximum")]
        except libe57.E57Exception:
            continue
        if said[0] <= least[k] <= most[k] <= said[1]:  # borders without any record count too
            least[k], most[k] = said
    columns, rows = (int(n) for n in most - least + 1)
    if columns < 2 or rows < 2 or columns * rows > MOST_CELLS * records:
        return None
    return least, (columns, rows)


def _cartesian(spherical: np.ndarray) -> np.ndarray:
    """Range, azimuth from x and elevation above the level plane to x, y, z."""
    range_m, azimuth, elevation = spherical.T
    across = range_m * np.cos(elevation)
    return np.stack(
        [across * np.cos(azimuth), across * np.sin(azimuth), range_m * np.sin(elevation)], axis=1
    )


def _numbered(cell: np.ndarray, range_m: np.ndarray) -> dict[str, np.ndarray]:
    """Return numbers where records share a cell of column and row: returns of one shot."""
    _, shot, count = np.unique(cell, return_inverse=True, return_counts=True)
    if len(count) == len(cell) or count.max() > 255:
        return {}
    order = np.lexsort((range_m, shot))
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    number = np.empty(len(cell), np.uint8)
    number[order] = np.arange(len(cell)) - first[shot[order]] + 1
    return {"ReturnNumber": number, "NumberOfReturns": count[shot].astype(np.uint8)}


def _our_name(name: str) -> str:
    """Our name of a field that is an attribute, empty for others; extensions are `prefix:name`."""
    if name in NAMES:
        return NAMES[name]
    ours = attribute_name(name.rpartition(":")[2])
    return ours if ours in KNOWN_NAMES and ":" in name else ""


def _typed(name: str, values: np.ndarray) -> np.ndarray:
    """In as few bytes as hold it."""
    if name == "ReturnNumber":
        values = values + 1  # E57 counts from 0
    if name in ("ReturnNumber", "NumberOfReturns") and ((values >= 0) & (values < 256)).all():
        return values.astype(np.uint8)
    if name in ("Red", "Green", "Blue"):
        for kind in (np.uint8, np.uint16):
            if len(values) and values.min() >= 0 and values.max() <= np.iinfo(kind).max:
                return values.astype(kind)
    return values if name == "GpsTime" else values.astype(np.float32)


@contextmanager
def _opened(path: Path) -> Iterator[pye57.E57]:
    """The open file; closed at the end, and an InputError where it is no E57 file."""
    try:
        file = pye57.E57(str(path))
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise InputError(
            path, f"no readable E57 file ({said})", "a complete E57 file", "Export it again."
        ) from error
    try:
        yield file
    finally:
        file.close()
