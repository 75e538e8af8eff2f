"""Points out of a LAZ file: by lazrs, or by PDAL where the file is of a kind that lazrs lacks."""

import os
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import lazrs

from dapple import pdal
from dapple.errors import InputError
from dapple.formats import cloud_las_header
from dapple.formats.cloud_las_header import LASZIP, Header
from dapple.programs import silenced

LAYERED = 3
"""Compressor of point formats 6 to 10, which keeps the parts of a point in layers."""
LAYERS, EXTRA_BYTES = {10: 9, 11: 1, 12: 2, 13: 1}, 14
"""Layers of an item by its kind; extra bytes have one each."""
POINTWISE = 1
"""Compressor of LASzip 1 and 2 that keeps one chunk and no table of chunks."""


def blocks(path: Path, header: Header, chunk: int) -> Iterator[bytes | bytearray]:
    """Uncompressed points, `chunk` at a time.

    Raises
    ------
    InputError
        The points cannot be uncompressed, or there are fewer than announced.
    """
    records = header.records.get(LASZIP, [])
    if not records or len(records[0]) < 34:
        raise InputError(
            path,
            "compressed points without the record that says how (laszip encoded, 22204)",
            "a complete LAZ file",
            "Export the file again.",
        )
    record = records[0]
    if struct.unpack_from("<H", record)[0] == POINTWISE:
        yield from _by_pdal(path, chunk)
        return
    _check_items(path, header, record)
    _check_chunks(path, header)
    _check_layers(path, header, record)
    with path.open("rb") as handle:
        handle.seek(header.data_at)
        decompressor = None
        for at in range(0, header.count, chunk):
            n = min(chunk, header.count - at)
            try:
                with silenced(2):  # lazrs prints a stack of its own where it gives up
                    if decompressor is None:
                        decompressor = lazrs.LasZipDecompressor(handle, record)
                    block = _block(decompressor, n, header.record_bytes)
            # A panic in Rust is no Exception; what may be pressed by the user goes through.
            except (KeyboardInterrupt, SystemExit, MemoryError):
                raise
            except BaseException as error:
                raise InputError(
                    path,
                    f"points that cannot be uncompressed after the first {at:,} ({error})",
                    f"a complete LAZ file of {header.count:,} points",
                    "Copy or export the file again; where that gives the same, `pdal translate "
                    "in.laz out.las` may read it.",
                ) from None
            yield block


def _block(decompressor: lazrs.LasZipDecompressor, n: int, record_bytes: int) -> bytearray:
    block = bytearray(n * record_bytes)
    decompressor.decompress_many(block)
    return block


def _check_items(path: Path, header: Header, record: bytes) -> None:
    """The sizes of the compressed items add up to the size of a point."""
    n_items = struct.unpack_from("<H", record, 32)[0]
    if len(record) < 34 + 6 * n_items:
        sizes = -1
    else:
        sizes = sum(struct.unpack_from("<H", record, 36 + 6 * k)[0] for k in range(n_items))
    if sizes != header.record_bytes:
        raise InputError(
            path,
            f"compressed items of {sizes} bytes and points of {header.record_bytes}",
            "as many of one as of the other",
            "Export the file again.",
        )


def _check_layers(path: Path, header: Header, record: bytes) -> None:
    """The layers of the first chunk fit into the file: lazrs takes memory for them as announced."""
    n_items = struct.unpack_from("<H", record, 32)[0]
    items = [struct.unpack_from("<HH", record, 34 + 6 * k) for k in range(n_items)]
    n_layers = sum(LAYERS.get(kind, size if kind == EXTRA_BYTES else 0) for kind, size in items)
    if struct.unpack_from("<H", record)[0] != LAYERED or not header.count:
        return
    with path.open("rb") as handle:
        handle.seek(header.data_at + 8 + header.record_bytes + 4)
        head = handle.read(4 * n_layers)
    lengths = struct.unpack(f"<{len(head) // 4}I", head[: len(head) // 4 * 4])
    size = path.stat().st_size
    if len(lengths) < n_layers or sum(lengths) > size:
        raise cloud_las_header.incomplete(
            path, f"{sum(lengths):,} bytes announced for the first points, in {size:,} bytes"
        )


def _check_chunks(path: Path, header: Header) -> None:
    """The table of chunks lies in the file and names no more chunks than fit."""
    size = path.stat().st_size
    with path.open("rb") as handle:
        handle.seek(header.data_at)
        at = int.from_bytes(handle.read(8), "little", signed=True)
        if at == -1:  # written by a program that could not go back: at the end of the file
            handle.seek(-8, os.SEEK_END)
            at = int.from_bytes(handle.read(8), "little", signed=True)
        if header.count and not header.data_at < at <= size - 8:
            raise cloud_las_header.incomplete(path, f"no table of chunks ({size:,} bytes)")
        handle.seek(max(at, 0))
        chunks = int.from_bytes(handle.read(8)[4:], "little")
    if header.count and not 0 < chunks <= size // 2:
        raise cloud_las_header.incomplete(path, f"a table of {chunks:,} chunks in {size:,} bytes")


def _by_pdal(path: Path, chunk: int) -> Iterator[bytes]:
    """The points as PDAL uncompresses them."""
    with tempfile.TemporaryDirectory(prefix="laz-") as folder:
        plain = Path(folder, "plain.las")
        pdal.uncompress(path, plain)
        yield from plain_blocks(plain, cloud_las_header.read(plain), chunk)


def plain_blocks(path: Path, header: Header, chunk: int) -> Iterator[bytes]:
    """Points of a LAS file, `chunk` at a time."""
    with path.open("rb") as handle:
        handle.seek(header.data_at)
        for at in range(0, header.count, chunk):
            yield handle.read(min(chunk, header.count - at) * header.record_bytes)
