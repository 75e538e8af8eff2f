"""The header of a LAS or LAZ file, every count in it held against the size of the file."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import laspy
import numpy as np

from dapple.errors import InputError

LEAST_HEADER = 227
RECORD_HEAD, EXTENDED_HEAD = 54, 60
LASZIP = ("laszip encoded", 22204)
EXTRA_BYTES = ("LASF_Spec", 4)
OTHER_FORMATS = {
    b"ply": "a PLY file",
    b"ASTM-E57": "an E57 file",
    b"PK": "a ZIP archive",
    b"# .PCD": "a PCD file",
    b"\x1f\x8b": "a gzip archive",
}


@dataclass(frozen=True)
class Header:
    """What a reader needs to know before the first point.

    Attributes
    ----------
    version : str
        As in "1.4".
    point_format : int
    compressed : bool
    record_bytes : int
        Size of a point.
    count : int
        Points, no more than the file can hold.
    data_at : int
        Place of the first point.
    scale, offset : (3,) float64
    low, high : (3,) float64
        Bounds as the header says; they may be wrong.
    records : dict of (str, int) to list of bytes
        Variable-length records by user and number.
    notes : tuple of str
    """

    version: str
    point_format: int
    compressed: bool
    record_bytes: int
    count: int
    data_at: int
    scale: np.ndarray
    offset: np.ndarray
    low: np.ndarray
    high: np.ndarray
    records: dict[tuple[str, int], list[bytes]]
    notes: tuple[str, ...]


def read(path: Path) -> Header:
    """Read and check the header.

    Raises
    ------
    InputError
        Not LAS, or a header that contradicts the file.
    """
    size = path.stat().st_size
    with path.open("rb") as handle:
        raw = handle.read(375)
        if raw[:4] != b"LASF":
            raise _not_las(path, raw)
        if len(raw) < LEAST_HEADER:
            raise incomplete(path, f"{size} bytes, less than a header")
        version = (raw[24], raw[25])
        data_at, n_records, kind = struct.unpack_from("<IIB", raw, 96)
        record_bytes, legacy = struct.unpack_from("<HI", raw, 105)
        header_bytes = struct.unpack_from("<H", raw, 94)[0]
        if not LEAST_HEADER <= header_bytes <= data_at:
            raise _wrong(path, f"a header of {header_bytes} bytes and points at byte {data_at}")
        if data_at > size:
            raise incomplete(path, f"{size:,} bytes, and its points are to begin at {data_at:,}")
        count, extended = legacy, (0, 0)
        if version >= (1, 4) and header_bytes >= 375 <= len(raw):
            extended = struct.unpack_from("<QI", raw, 235)
            count = struct.unpack_from("<Q", raw, 247)[0] or legacy
        notes: list[str] = []
        places = [(header_bytes, data_at, n_records, RECORD_HEAD)]
        if extended[1]:
            places.append((extended[0], size, extended[1], EXTENDED_HEAD))
        records: dict[tuple[str, int], list[bytes]] = {}
        for place in places:
            for key, record in _records(path, handle, *place):
                records.setdefault(key, []).append(record)
    point_format = kind & 0x3F
    if point_format > 10:
        raise _wrong(path, f"point format {point_format}")
    least = laspy.PointFormat(point_format).size
    if record_bytes < least:
        raise _wrong(
            path, f"points of {record_bytes} bytes, and format {point_format} takes {least}"
        )
    compressed = bool(kind & 0xC0) or LASZIP in records
    scale, offset = (np.array(struct.unpack_from("<3d", raw, at)) for at in (131, 155))
    _check_scale(path, scale, offset)
    if not compressed:
        count = _count_of(path, count, (size - data_at) // record_bytes, extended, notes)
    bounds = np.array(struct.unpack_from("<6d", raw, 179)).reshape(3, 2)
    return Header(
        "{}.{}".format(*version),
        point_format,
        compressed,
        record_bytes,
        count,
        data_at,
        scale,
        offset,
        bounds[:, 1],
        bounds[:, 0],
        records,
        tuple(notes),
    )


def _records(
    path: Path, handle: BinaryIO, start: int, end: int, announced: int, head_bytes: int
) -> Iterator[tuple[tuple[str, int], bytes]]:
    """Key and content of the records between `start` and `end`.

    Raises
    ------
    InputError
        More are announced than fit: then the rest of the header is not to be trusted either.
    """
    length_format = "<H" if head_bytes == RECORD_HEAD else "<Q"
    at = start
    for number in range(announced):
        if not 0 <= at <= end:
            raise _wrong(path, f"records announced at byte {at:,}")
        handle.seek(at)
        head = handle.read(head_bytes)
        length = struct.unpack_from(length_format, head, 20)[0] if len(head) == head_bytes else 0
        if len(head) < head_bytes or at + head_bytes + length > end:
            raise _wrong(path, f"{announced:,} records announced, of which {number} are there")
        user = head[2:18].split(b"\0")[0].decode("ascii", "replace")
        yield (user, struct.unpack_from("<H", head, 18)[0]), handle.read(length)
        at += head_bytes + length


def _count_of(path: Path, announced: int, held: int, extended, notes: list[str]) -> int:
    """How many points there are: what is announced, where the file holds as many."""
    if announced > held:
        raise incomplete(path, f"{held:,} of the {announced:,} points that it announces")
    if not announced and held and not extended[1]:
        notes.append(f"The header announces no point, and {held:,} are there: it was never closed.")
        return held
    return announced


def _check_scale(path: Path, scale: np.ndarray, offset: np.ndarray) -> None:
    if not (np.isfinite(scale).all() and np.isfinite(offset).all() and (scale > 0).all()):
        raise _wrong(path, f"a scale of {scale.tolist()} and an offset of {offset.tolist()}")


def incomplete(path: Path, found: str) -> InputError:
    """The error of a file that ends too early."""
    return InputError(
        path,
        found,
        "a complete LAS or LAZ file",
        "The copy or the export was cut off: copy or export the file again.",
    )


def _wrong(path: Path, found: str) -> InputError:
    return InputError(
        path,
        f"a header with {found}",
        "a LAS or LAZ file of version 1.0 to 1.4",
        "Export the file again from the program that made it.",
    )


def _not_las(path: Path, raw: bytes) -> InputError:
    kind = next((what for mark, what in OTHER_FORMATS.items() if raw.startswith(mark)), None)
    if kind is None:
        text = raw[:60].decode("ascii", "replace")
        kind = f"text ('{text.splitlines()[0][:40]}')" if text.isprintable() or "\n" in text else ""
    return InputError(
        path,
        f"{kind or 'another kind of file'}: its first bytes are not LASF",
        "a LAS or LAZ file",
        "Give the file the suffix of what it is (.ply, .e57, .txt, ...), or export it again.",
    )
