"""Point clouds in the local frame: read and write, with their origin and attributes."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dapple import frames
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import cloud_e57, cloud_las, cloud_pcd, cloud_ply, cloud_ptx, cloud_text
from dapple.formats.cloud_raw import Fired, RawCloud, Source
from dapple.formats.ordered_scan import OrderedScan

LEAF, WOOD = 4, 0
"""ASPRS-like class codes: 4 leaf, 0 wood."""

READERS = {
    **dict.fromkeys((".las", ".laz"), cloud_las.read),
    ".ply": cloud_ply.read,
    ".e57": cloud_e57.read,
    ".ptx": cloud_ptx.read,
    ".pcd": cloud_pcd.read,
    **dict.fromkeys((".txt", ".xyz", ".csv", ".asc", ".pts"), cloud_text.read),
}
SIGNATURES: dict[bytes, tuple[str, tuple[str, ...]]] = {
    b"LASF": ("LAS or LAZ", (".laz", ".las")),
    b"ASTM-E57": ("E57", (".e57",)),
    b"ply\n": ("PLY", (".ply",)),
    b"ply\r": ("PLY", (".ply",)),
    b"\x1f\x8b": ("a gzip archive", ()),
    b"PK\x03\x04": ("a zip archive", ()),
}
"""Formats by their first bytes, and the suffixes that they have."""
FIRED = {
    ".ply": cloud_ply.read_fired,
    **dict.fromkeys((".txt", ".xyz", ".csv"), cloud_text.read_fired),
}
ORDERED = {".ptx": cloud_ptx.scans, ".e57": cloud_e57.scans}
WRITERS = {
    **dict.fromkeys((".las", ".laz"), cloud_las.write),
    ".ply": cloud_ply.write,
    **dict.fromkeys((".txt", ".xyz", ".csv", ".asc"), cloud_text.write),
}


@dataclass(frozen=True)
class Cloud:
    """Points with attributes.

    Attributes
    ----------
    xyz_m : (n, 3) float64
        Local frame: east, north, up [m].
    origin_m : (3,) float64
        World coordinates of the local origin [m].
    attributes : dict of str to (n,) array
        By name, as in the file: `Reflectance` [dB], `Deviation`, `Classification`,
        `ReturnNumber`, `NumberOfReturns`, `PointSourceId` (scan position), ...
    """

    xyz_m: np.ndarray
    origin_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    attributes: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.xyz_m)

    def select(self, chosen: np.ndarray | slice) -> "Cloud":
        """The points that a mask or an index array chooses, in the same frame."""
        attributes = {name: values[chosen] for name, values in self.attributes.items()}
        return Cloud(self.xyz_m[chosen], self.origin_m, attributes)

    @property
    def world_xyz_m(self) -> np.ndarray:
        """(n, 3) world coordinates [m]."""
        return frames.to_world(self.xyz_m, self.origin_m)


def read(path: str | Path) -> Cloud:
    """Read a cloud; `read_with_source` also tells what its file says of itself."""
    return read_with_source(path)[0]


def read_with_source(path: str | Path) -> tuple[Cloud, Source]:
    """Read a cloud; the suffix names the format.

    Parameters
    ----------
    path : str or Path
        LAS, LAZ, PLY (ASCII or binary; CloudCompare's `scalar_` prefix is dropped), PCD, E57 and
        PTX (all scans, posed; `PointSourceId` counts them from 1), or text with or without a
        header.

    Returns
    -------
    cloud : Cloud
        In the local frame. The origin is the one in the file (LAS offset, PLY comment); where
        there is none, `frames.choose_origin` finds one if float32 would be too coarse.
    source : Source
        Coordinate system, units and scans as the file has them, and what of it was not taken.

    Raises
    ------
    EmptyCloudError
        No point.
    InputError
        No such file, unknown suffix, a file that is incomplete or contradicts itself, coordinates
        that are not finite or that have already lost their millimetres.
    """
    path = Path(path)
    if path.is_file():
        _is_what_it_is_called(path)
    reader = _by_suffix(path, READERS, "read")
    _exists(path)
    raw = reader(path)
    return _to_cloud(path, raw), raw.source


def iterate(path: str | Path, chunk: int = 1_000_000) -> Iterator[Cloud]:
    """Read a LAS or LAZ file in pieces of at most `chunk` points, all with one origin.

    For clouds that do not fit into memory; errors as for `read`.
    """
    path = Path(path)
    _by_suffix(path, dict.fromkeys((".las", ".laz"), None), "read in pieces")
    _exists(path)
    for raw in cloud_las.iterate(path, chunk):
        yield _to_cloud(path, raw)


def write(path: str | Path, cloud: Cloud, **options) -> None:
    """Write a cloud whole or not at all; the suffix names the format.

    Parameters
    ----------
    path : str or Path
        LAS, LAZ (1.4, point format 6, offset = origin), binary PLY, or text; world coordinates.
    cloud : Cloud
        What to write; floating-point attributes become float32 where they fit.
    **options
        For LAS and LAZ: `scale_m`, the step of the stored coordinates (0.0001 m), and `crs`, the
        coordinate system, as in "EPSG:25832".
    """
    path = Path(path)
    writer = _by_suffix(path, WRITERS, "write")
    writer(path, RawCloud(cloud.xyz_m, cloud.origin_m, cloud.attributes), **options)


def require(cloud: Cloud, name: str, path: str | Path, notes: Iterable[str] = ()) -> np.ndarray:
    """The values of an attribute, or an error that lists those that there are.

    Of the notes of a reader those on the attribute are part of the message.
    """
    if name in cloud.attributes:
        return cloud.attributes[name]
    there = ", ".join(sorted(cloud.attributes)) or "none"
    said = "".join(f"{note} " for note in notes if name in note)
    raise InputError(
        path,
        f"no attribute '{name}' (there are: {there})",
        f"'{name}' with every point",
        f"{said}Export '{name}' from the scanner's software as an extra dimension, rename the "
        "column that holds it, or choose a method that does without it "
        "(classify: {method: geometry}).",
    )


def scan_positions(path: str | Path) -> np.ndarray | None:
    """World coordinates of the scanner for each scan of an E57 or PTX file, (s, 3) [m].

    None for formats that do not keep them. Scan number k (`PointSourceId`, from 1) is row k - 1.
    """
    scans = read_with_source(path)[1].scans
    known = [scan.position_m for scan in scans if scan.position_m is not None]
    return np.array(known) if known and len(known) == len(scans) else None


def ordered_scans(path: str | Path) -> Iterator[tuple[int, OrderedScan]]:
    """Number and content of every ordered scan of a PTX or E57 file, one in memory at a time."""
    path = Path(path)
    reader = _by_suffix(path, ORDERED, "read as ordered scans")
    _exists(path)
    yield from reader(path)


def fired(path: str | Path) -> Fired | None:
    """The shots that a ray cloud or a table of shots tells one by one; None for other files."""
    path = Path(path)
    _exists(path)
    reader = FIRED.get(path.suffix.lower())
    return None if reader is None else reader(path)


def _by_suffix(path: Path, table: dict, action: str):
    suffix = path.suffix.lower()
    if suffix not in table:
        raise InputError(
            path,
            f"suffix '{path.suffix}'",
            f"one that dapple can {action}: {', '.join(table)}",
            "Convert the file, or rename it if only its suffix is wrong.",
        )
    return table[suffix]


def _exists(path: Path) -> None:
    if not path.is_file():
        raise InputError(path, "no file", "a point cloud", "Check the path in the configuration.")
    if path.stat().st_size == 0:
        raise InputError(
            path, "an empty file (0 bytes)", "a point cloud", "Copy or export the file again."
        )


def _is_what_it_is_called(path: Path) -> None:
    """The first bytes are not those of another format than the suffix says."""
    with path.open("rb") as file:
        head = file.read(8)
    for start, (kind, suffixes) in SIGNATURES.items():
        if head.startswith(start) and path.suffix.lower() not in suffixes:
            remedy = f"Rename it to end in {suffixes[0]}." if suffixes else "Unpack it first."
            raise InputError(
                path, f"a file that begins as {kind} does", f"the format of '{path.suffix}'", remedy
            )


def _to_cloud(path: Path, raw: RawCloud) -> Cloud:
    """Check what a reader found and bring it into the local frame."""
    if not len(raw.xyz_m):
        raise EmptyCloudError(
            path, "0 points", "at least one point", "Check the export, or the filter before it."
        )
    bad = ~np.isfinite(raw.xyz_m).all(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise InputError(
            path,
            f"{bad.sum()} points with coordinates that are no numbers, the first is point "
            f"{first}: {raw.xyz_m[first].tolist()}",
            "finite coordinates in metres",
            "Remove these points or export the cloud again.",
        )
    attributes = dict(raw.attributes)
    if "Intensity" in attributes and not _is_16_bit(attributes["Intensity"]):
        # LAS holds intensity in 16 bits; other scales keep their numbers under another name.
        attributes["RelativeIntensity"] = attributes.pop("Intensity").astype(np.float32)
    xyz, origin = raw.xyz_m, raw.origin_m
    shift = frames.choose_origin(xyz)
    if not raw.final and shift.any():
        xyz, origin = xyz - shift, origin + shift
    return Cloud(xyz, origin, attributes)


def _is_16_bit(values: np.ndarray) -> bool:
    if values.dtype.kind in "ui":
        return bool(values.min() >= 0 and values.max() <= 65535)
    return bool(np.all((values >= 0) & (values <= 65535) & (values == np.rint(values))))
