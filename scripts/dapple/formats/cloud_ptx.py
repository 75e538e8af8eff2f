"""PTX (Leica Cyclone): ordered scans with their poses, and with the shots that met nothing.

Each scan: columns, rows, scanner position, three axes, a 4 × 4 matrix for row vectors (translation
in its last row), then one line a shot, column by column: `x y z intensity [r g b]` in the scanner's
frame. `0 0 0` is a shot without return.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from dapple import frames
from dapple.errors import InputError
from dapple.formats.cloud_raw import RawCloud


@dataclass(frozen=True)
class PtxScan:
    """One ordered scan.

    Attributes
    ----------
    xyz_m : (columns, rows, 3) float64
        Scanner's frame [m]; (0, 0, 0) where the shot met nothing.
    rotation : (3, 3) float64
        world = rotation @ scanner + position.
    position_m : (3,) float64
        Scanner in the world [m].
    intensity : (columns, rows) float32
    colour : (columns, rows, 3) uint8 or None
    """

    xyz_m: np.ndarray
    rotation: np.ndarray
    position_m: np.ndarray
    intensity: np.ndarray
    colour: np.ndarray | None = None

    @property
    def hit(self) -> np.ndarray:
        """(columns, rows) whether the shot has a return."""
        return self.xyz_m.any(axis=2)


def read(path: Path) -> RawCloud:
    """Points of all scans in the world, misses left out; `PointSourceId` counts from 1."""
    parts, attributes = [], []
    for number, scan in enumerate(scans(path), 1):
        hit = scan.hit
        parts.append(scan.xyz_m[hit] @ scan.rotation.T + scan.position_m)
        fields = {
            "Intensity": scan.intensity[hit],
            "PointSourceId": np.full(int(hit.sum()), number, np.uint16),
        }
        if scan.colour is not None:
            fields |= dict(zip(("Red", "Green", "Blue"), scan.colour[hit].T, strict=True))
        attributes.append(fields)
    common = set.intersection(*(set(fields) for fields in attributes))
    origin = frames.choose_origin(np.concatenate(parts))
    return RawCloud(
        np.concatenate([part - origin for part in parts]),
        origin,
        {name: np.concatenate([f[name] for f in attributes]) for name in sorted(common)},
        final=True,
    )


def scan_positions(path: Path) -> np.ndarray:
    """(s, 3) world coordinates of the scanner of each scan [m]."""
    return np.array([scan.position_m for scan in scans(path)])


def scans(path: str | Path) -> Iterator[PtxScan]:
    """Read the scans of a file one after the other."""
    path = Path(path)
    with path.open(encoding="ascii", errors="replace") as handle:
        number = 0
        while line := next(handle, ""):
            if line.strip():
                number += 1
                yield _scan(path, handle, line, number)
    if not number:
        raise _damaged(path, "no scan")


def _scan(path: Path, handle, first_line: str, number: int) -> PtxScan:
    head = [first_line, *islice(handle, 9)]
    try:
        columns, rows = int(head[0]), int(head[1])
        position = np.array([float(word) for word in head[2].split()])
        matrix = np.array([[float(word) for word in line.split()] for line in head[6:10]])
    except (ValueError, IndexError) as error:
        raise _damaged(path, f"a header of scan {number} that cannot be read ({error})") from error
    if matrix.shape != (4, 4) or position.shape != (3,):
        raise _damaged(path, f"a header of scan {number} without position and 4 × 4 matrix")
    _check_rotation(path, matrix[:3, :3], number)
    try:
        table = np.loadtxt(islice(handle, columns * rows), ndmin=2)
    except ValueError as error:
        raise _damaged(path, f"scan {number}: {error}") from error
    if len(table) != columns * rows:
        raise _damaged(path, f"{len(table)} of the {columns * rows} shots of scan {number}")
    if table.shape[1] not in (4, 7):
        raise _damaged(path, f"{table.shape[1]} columns in scan {number}")
    grid = table.reshape(columns, rows, -1)
    return PtxScan(
        grid[..., :3],
        matrix[:3, :3].T,
        matrix[3, :3],
        grid[..., 3].astype(np.float32),
        grid[..., 4:].astype(np.uint8) if grid.shape[2] == 7 else None,
    )


def _check_rotation(path: Path, matrix: np.ndarray, number: int) -> None:
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3) or np.linalg.det(matrix) < 0:
        raise InputError(
            path,
            f"a matrix in scan {number} that is no rotation:\n{matrix}",
            "a rotation and a translation",
            "Export without scaling or mirroring.",
        )


def _damaged(path: Path, found: str) -> InputError:
    return InputError(
        path,
        found,
        "complete PTX scans: 10 header lines, then columns × rows lines of 'x y z i' or "
        "'x y z i r g b'",
        "Export the file again.",
    )
