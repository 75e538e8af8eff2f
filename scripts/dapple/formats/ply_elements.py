"""Elements of PLY files: any order, ASCII or binary, with properties that are lists."""

from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dapple.errors import InputError

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("long", "int64"), "i8"),
    **dict.fromkeys(("ulong", "uint64"), "u8"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
VERTICES = {"vertices": "vertex", "point": "vertex", "points": "vertex"}
"""What some programs call them."""
FORMS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
LONGEST_LINE = 1 << 16


@dataclass(frozen=True)
class Property:
    """A property of an element; `length` is the type of a list's length, empty for a number."""

    name: str
    kind: str
    length: str = ""


@dataclass(frozen=True)
class Element:
    """Rows of one kind: its name, how many, and their properties."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def has_lists(self) -> bool:
        return any(p.length for p in self.properties)

    def dtype(self, order: str, lengths: dict[str, int] | None = None) -> np.dtype:
        """Of a row, its lists being of these lengths."""
        fields: list[tuple] = []
        for p in self.properties:
            if p.length:
                fields.append((f"{p.name} length", order + p.length))
                fields.append((p.name, order + p.kind, ((lengths or {})[p.name],)))
            else:
                fields.append((p.name, order + p.kind))
        return np.dtype(fields)


@dataclass(frozen=True)
class Header:
    """Byte order (empty for ASCII), elements in their order, and the origin if one is named."""

    form: str
    elements: tuple[Element, ...]
    origin: np.ndarray | None


def read_header(path: Path, handle: BinaryIO) -> Header:
    """Read up to `end_header`.

    Raises
    ------
    InputError
        Not a PLY file, or a line of the header that means nothing.
    """
    if handle.readline(LONGEST_LINE).strip() != b"ply":
        raise damaged(path, "a first line that is not 'ply'")
    form, origin = None, None
    elements: list[tuple[str, int, list[Property]]] = []
    while (line := handle.readline(LONGEST_LINE)).strip() != b"end_header":
        if not line:
            raise damaged(path, "a header without end_header")
        words = line.decode("ascii", "replace").split()
        try:
            match words:
                case ["format", name, *_]:
                    form = FORMS[name]
                case ["comment", "origin_m", *values]:
                    origin = np.array([float(value) for value in values[:3]])
                case ["element", name, count]:
                    elements.append((VERTICES.get(name, name), int(count), []))
                case ["property", "list", length, kind, name]:
                    elements[-1][2].append(Property(name, TYPES[kind], TYPES[length]))
                case ["property", kind, name]:
                    name = name.lower() if name in ("X", "Y", "Z") else name
                    elements[-1][2].append(Property(name, TYPES[kind]))
        except (KeyError, IndexError, ValueError) as error:
            raise damaged(path, f"the header line `{' '.join(words)[:80]}`") from error
    if form is None:
        raise damaged(path, "no format")
    if origin is not None and (origin.shape != (3,) or not np.isfinite(origin).all()):
        origin = None
    found = tuple(Element(name, count, tuple(own)) for name, count, own in elements)
    for element in found:
        names = [p.name for p in element.properties]
        if element.count < 0 or len(set(names)) < len(names):
            raise damaged(path, f"element {element.name} with {element.count} rows of {names}")
    vertex = next((e for e in found if e.name == "vertex"), None)
    plain = {p.name for p in vertex.properties if not p.length} if vertex else set()
    if not {"x", "y", "z"} <= plain:
        raise damaged(path, "no vertices with x, y and z")
    return Header(form, found, origin)


def skip(path: Path, handle: BinaryIO, form: str, element: Element, size: int) -> None:
    """Go on to the next element."""
    if not form:
        for _ in range(element.count):
            if not handle.readline():
                raise damaged(path, f"an end within the element {element.name}")
    elif element.has_lists:
        read(path, handle, form, element, size)
    else:
        handle.seek(element.count * element.dtype(form).itemsize, 1)


def read(
    path: Path, handle: BinaryIO, form: str, element: Element, size: int
) -> dict[str, np.ndarray]:
    """Values by property; lists of one length as (n, k) arrays, others are left out.

    Parameters
    ----------
    size : int
        Bytes of the file: no more rows than fit are made room for.
    """
    left = size - handle.tell()
    least = 2 if not form else element.dtype(form, {p.name: 0 for p in element.properties}).itemsize
    unended = 0 if form else 1  # the last line of text may lack its end
    if element.count * max(least, 1) > left + unended:
        raise damaged(
            path,
            f"a truncated file: {max(left, 0):,} bytes for {element.count:,} {element.name} rows",
        )
    if not element.properties:
        return {}
    if not form:
        return _ascii(path, handle, element)
    if element.has_lists:
        return _binary_lists(path, handle, form, element)
    dtype = element.dtype(form)
    rows = np.frombuffer(handle.read(element.count * dtype.itemsize), dtype)
    return {p.name: _native(rows[p.name]) for p in element.properties}


def _native(values: np.ndarray) -> np.ndarray:
    """In this machine's byte order, on its own."""
    return np.array(values, values.dtype.newbyteorder("="))


def _binary_lists(path: Path, handle: BinaryIO, form: str, element: Element) -> dict:
    start = handle.tell()
    lengths = _lengths_of_first(path, handle, form, element)
    dtype = element.dtype(form, lengths)
    handle.seek(start)
    data = handle.read(element.count * dtype.itemsize)
    rows = np.frombuffer(data, dtype, len(data) // dtype.itemsize)
    if all((rows[f"{name} length"] == length).all() for name, length in lengths.items()):
        if len(rows) < element.count:
            raise damaged(
                path, f"a truncated file: {len(rows)} of {element.count} {element.name} rows"
            )
        return {p.name: _native(rows[p.name]) for p in element.properties}
    del data, rows
    handle.seek(start)
    return _binary_row_by_row(path, handle, form, element)


def _lengths_of_first(path: Path, handle: BinaryIO, form: str, element: Element) -> dict[str, int]:
    lengths = {p.name: 0 for p in element.properties if p.length}
    if element.count:
        row = _row(path, handle, form, element)
        lengths = {name: len(row[name]) for name in lengths}
    return lengths


def _binary_row_by_row(path: Path, handle: BinaryIO, form: str, element: Element) -> dict:
    plain = [p for p in element.properties if not p.length]
    found = {p.name: np.empty(element.count, p.kind) for p in plain}
    for number in range(element.count):
        row = _row(path, handle, form, element)
        for p in plain:
            found[p.name][number] = row[p.name][0]
    return found


def _row(path: Path, handle: BinaryIO, form: str, element: Element) -> dict[str, np.ndarray]:
    row = {}
    for p in element.properties:
        n = 1
        if p.length:
            n = int(_numbers(path, handle, form + p.length, 1)[0])
        row[p.name] = _numbers(path, handle, form + p.kind, n)
    return row


def _numbers(path: Path, handle: BinaryIO, kind: str, n: int) -> np.ndarray:
    dtype = np.dtype(kind)
    data = handle.read(n * dtype.itemsize) if n >= 0 else b""
    if n < 0 or len(data) < n * dtype.itemsize:
        raise damaged(path, "a truncated file: a list goes on beyond its end")
    return np.frombuffer(data, dtype, n)


def _ascii(path: Path, handle: BinaryIO, element: Element) -> dict[str, np.ndarray]:
    if not element.count:
        return {p.name: np.empty(0, p.kind) for p in element.properties if not p.length}
    if element.has_lists:
        return _ascii_row_by_row(path, handle, element)
    rows = islice((line for line in handle if line.strip()), element.count)
    try:
        table = np.loadtxt(rows, ndmin=2, usecols=range(len(element.properties)))
    except ValueError as error:
        raise damaged(path, str(error)) from error
    if len(table) < element.count:
        raise damaged(path, f"{len(table)} of {element.count} rows of {element.name}")
    return {p.name: _of_kind(table[:, k], p.kind) for k, p in enumerate(element.properties)}


def _ascii_row_by_row(path: Path, handle: BinaryIO, element: Element) -> dict[str, np.ndarray]:
    plain = [p for p in element.properties if not p.length]
    found = {p.name: np.empty(element.count) for p in plain}
    for number in range(element.count):
        words = handle.readline().split()
        try:
            at = 0
            for p in element.properties:
                if p.length:
                    at += 1 + int(words[at])
                else:
                    found[p.name][number] = float(words[at])
                    at += 1
        except (IndexError, ValueError) as error:
            raise damaged(path, f"row {number + 1} of {element.name}: {words[:8]}") from error
    return {p.name: _of_kind(found[p.name], p.kind) for p in plain}


def _of_kind(values: np.ndarray, kind: str) -> np.ndarray:
    """As the header declares them, where they fit; else as they are."""
    if kind[0] == "f":
        with np.errstate(over="ignore"):
            return values.astype(kind)
    limits = np.iinfo(kind)
    fits = np.isfinite(values).all() and ((values >= limits.min) & (values <= limits.max)).all()
    return values.astype(kind) if fits else values


def damaged(path: Path, found: str) -> InputError:
    """The error of a file that cannot be read as PLY."""
    return InputError(path, found, "a complete PLY file", "Export it again, binary little endian.")
