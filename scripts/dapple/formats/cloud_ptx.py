"""PTX (Leica Cyclone): ordered scans with their poses, and with the shots that met nothing.

Each scan: columns, rows, scanner position, three axes, a 4 × 4 matrix for row vectors (translation
in its last row), then one line a shot, column by column: `x y z intensity [r g b]` in the scanner's
frame. `0 0 0`, of some programs `nan nan nan`, is a shot without return.
"""

import io
import warnings
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pandas as pd

from dapple import frames
from dapple.errors import InputError
from dapple.formats.cloud_raw import MISSED, RawCloud, ScanFacts, Source, joined
from dapple.formats.ordered_scan import OrderedScan

LINES = 1_000_000
"""Read at once."""
SHORTEST_LINE = 6
"""Bytes of `0 0 0` and the end of its line."""


def read(path: Path) -> RawCloud:
    """Points of all scans in the world, misses left out; `PointSourceId` counts from 1."""
    pieces, facts, origin = [], [], None
    for number, scan in scans(path):
        world = scan.world_xyz_m
        if origin is None and len(world):
            origin = frames.choose_origin(world)
        fields = {"PointSourceId": np.full(len(world), number, np.uint16), **scan.attributes}
        if origin is not None:
            pieces.append({"xyz": world - origin, **fields})
        facts.append(ScanFacts(number, scan.position_m, len(world), int(np.prod(scan.shape))))
    shots = sum(scan.shots or 0 for scan in facts)
    points = sum(scan.points for scan in facts)
    source = Source(shots, left_out={MISSED: shots - points}, scans=tuple(facts))
    if origin is None or not pieces:
        return RawCloud(np.empty((0, 3)), source=source)
    attributes = joined(pieces)
    return RawCloud(attributes.pop("xyz"), origin, attributes, True, source)


def scans(path: Path) -> Iterator[tuple[int, OrderedScan]]:
    """Number, from 1, and content of the scans of a file one after the other."""
    size, number = path.stat().st_size, 0
    with path.open("rb") as handle:
        while line := next(handle, b""):
            if line.strip():
                number += 1
                yield number, _scan(path, handle, line, number, size)
    if not number:
        raise _wrong(path, "no scan")


def _scan(path: Path, handle: BinaryIO, first: bytes, number: int, size: int) -> OrderedScan:
    head = [first, *islice(handle, 9)]
    try:
        columns, rows = int(head[0]), int(head[1])
        position = np.array([float(word) for word in head[2].split()])
        matrix = np.array([[float(word) for word in line.split()] for line in head[6:10]])
    except (ValueError, IndexError) as error:
        said = " ".join(str(error).split())[:100]
        raise _wrong(path, f"a header of scan {number} that cannot be read ({said})") from error
    if matrix.shape != (4, 4) or position.shape != (3,):
        raise _wrong(path, f"a header of scan {number} without position and 4 × 4 matrix")
    if not (np.isfinite(matrix).all() and np.isfinite(position).all()):
        raise _wrong(path, f"a header of scan {number} with numbers that are not finite")
    _check_rotation(path, matrix[:3, :3], number)
    left = size - handle.tell()
    if columns < 1 or rows < 1 or columns * rows > left // SHORTEST_LINE + 1:
        raise _wrong(
            path, f"{columns:,} × {rows:,} shots in the header of scan {number}, and {left:,} bytes"
        )
    found = _returns(path, handle, columns * rows, number)
    cell = found.pop("cell")
    return OrderedScan(
        found.pop("xyz"),
        cell // rows,
        cell % rows,
        (columns, rows),
        matrix[:3, :3].T,
        matrix[3, :3],
        found,
    )


def _returns(path: Path, handle: BinaryIO, shots: int, number: int) -> dict[str, np.ndarray]:
    """Cell, place and attributes of the shots that have a return."""
    pieces, at = [], 0
    while at < shots:
        n = min(LINES, shots - at)
        lines = list(islice(handle, n))
        if len(lines) < n:
            raise _wrong(path, f"{at + len(lines):,} of the {shots:,} shots of scan {number}")
        table = _numbers(path, b"".join(lines), number)
        if len(table) != n:
            raise _wrong(path, f"an empty line among the shots of scan {number}")
        hit = table[:, :3].any(axis=1) & ~np.isnan(table[:, :3]).any(axis=1)
        kept = table[hit]
        piece = {"xyz": kept[:, :3], "cell": np.flatnonzero(hit) + at}
        if table.shape[1] > 3:
            piece["Intensity"] = kept[:, 3].astype(np.float32)
        if table.shape[1] == 7:
            colour = np.clip(np.nan_to_num(kept[:, 4:]), 0, 255).astype(np.uint8)
            piece |= dict(zip(("Red", "Green", "Blue"), colour.T, strict=True))
        pieces.append(piece)
        at += n
    return joined(pieces)


def _numbers(path: Path, text: bytes, number: int) -> np.ndarray:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            table = pd.read_csv(
                io.BytesIO(text),
                sep=r"\s+",
                header=None,
                dtype=np.float64,
                index_col=False,
                encoding="latin-1",
            ).to_numpy()
    except (ValueError, pd.errors.ParserWarning) as error:
        said = " ".join(str(error).split())[:150]
        raise _wrong(path, f"scan {number}: {said}") from error
    if table.shape[1] not in (3, 4, 7):
        raise _wrong(path, f"{table.shape[1]} columns in scan {number}")
    return table


def _check_rotation(path: Path, matrix: np.ndarray, number: int) -> None:
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3) or np.linalg.det(matrix) < 0:
        raise InputError(
            path,
            f"a matrix in scan {number} that is no rotation:\n{matrix}",
            "a rotation and a translation",
            "Export without scaling or mirroring.",
        )


def _wrong(path: Path, found: str) -> InputError:
    return InputError(
        path,
        found,
        "complete PTX scans: 10 header lines, then columns × rows lines of 'x y z i' or "
        "'x y z i r g b'",
        "Export the file again.",
    )
