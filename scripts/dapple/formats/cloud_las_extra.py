"""Extra bytes of LAS points: their descriptions, in one record or several, and their values."""

import struct
from dataclasses import dataclass

import numpy as np

from dapple.formats.cloud_raw import attribute_name, columns, distinct

DESCRIPTION_BYTES = 192
TYPES = ("", "u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")
NO_DATA, SCALED, SHIFTED = 1, 8, 16
"""Bits of a description's options."""

LEFT_BY_PDAL = {"ClassFlags"}
"""Extra dimensions that PDAL adds by itself when it keeps all."""


@dataclass(frozen=True)
class ExtraField:
    """One described field: its name, place in a point's extra bytes, and how to read it."""

    name: str
    at: int
    dtype: np.dtype
    no_data: np.ndarray | None
    scale: np.ndarray
    shift: np.ndarray


def describe(
    records: list[bytes], n_bytes: int, taken: set[str]
) -> tuple[list[ExtraField], tuple[str, ...]]:
    """Fields that the records describe, and notes on what they leave open.

    Parameters
    ----------
    records : list of bytes
        The records `LASF_Spec` 4 of the file, in its order.
    n_bytes : int
        Extra bytes of a point.
    taken : set of str
        Names of the standard fields: an extra field of such a name becomes `extra_<name>`.
    """
    fields, notes, at = [], [], 0
    descriptions = [
        record[k : k + DESCRIPTION_BYTES]
        for record in records
        for k in range(0, len(record) - DESCRIPTION_BYTES + 1, DESCRIPTION_BYTES)
    ]
    for description in descriptions:
        kind, options = description[2], description[3]
        if kind == 0:  # undocumented: as many bytes as the options say
            at += options
            continue
        if kind > 30:
            notes.append(f"Extra bytes from the {at + 1}th on have an unknown type ({kind}).")
            break
        base, count = TYPES[(kind - 1) % 10 + 1], (kind - 1) // 10 + 1
        dtype = np.dtype((f"<{base}", (count,))) if count > 1 else np.dtype(f"<{base}")
        if at + dtype.itemsize > n_bytes:
            notes.append("The records describe more extra bytes than a point has.")
            break
        fields.append(_field(description, at, dtype, base, options, count))
        at += dtype.itemsize
    if at < n_bytes:
        notes.append(f"{n_bytes - at} extra bytes of every point are not described: left out.")
    return _named(fields, taken, notes), tuple(notes)


def values(extra: np.ndarray, field: ExtraField) -> dict[str, np.ndarray]:
    """The values of a field by attribute name; more than one where it is an array.

    Parameters
    ----------
    extra : (n, b) uint8
        Extra bytes of all points.
    """
    size = field.dtype.itemsize
    raw = np.ascontiguousarray(extra[:, field.at : field.at + size]).view(field.dtype.base)
    raw = raw[:, 0] if field.dtype.ndim == 0 else raw
    found = raw
    if (field.scale != 1).any() or (field.shift != 0).any():
        found = raw * field.scale + field.shift
    if field.no_data is not None:
        missing = raw == field.no_data
        if missing.any():
            found = np.where(missing, np.nan, found)
    return columns(field.name, found)


def _field(description: bytes, at: int, dtype, base: str, options: int, count: int) -> ExtraField:
    name = description[4:36].split(b"\0")[0].decode("utf-8", "replace").strip()
    # The value that stands for none is stored in eight bytes of the type's kind.
    wide = np.dtype("<" + {"u": "u8", "i": "i8", "f": "f8"}[base[0]])
    no_data = np.frombuffer(description, wide, count, 40) if options & NO_DATA else None
    scale, shift = np.ones(count), np.zeros(count)
    if options & SCALED:
        scale = np.array(struct.unpack_from(f"<{count}d", description, 112))
    if options & SHIFTED:
        shift = np.array(struct.unpack_from(f"<{count}d", description, 136))
    if not (np.isfinite(scale).all() and np.isfinite(shift).all()) or not scale.all():
        scale, shift = np.ones(count), np.zeros(count)
    if count == 1:
        return ExtraField(
            name, at, dtype, None if no_data is None else no_data[0], scale[0], shift[0]
        )
    return ExtraField(name, at, dtype, no_data, scale, shift)


def _named(fields: list[ExtraField], taken: set[str], notes: list[str]) -> list[ExtraField]:
    """Our names, none of them twice."""
    wanted = []
    for number, field in enumerate(fields, 1):
        name = attribute_name(field.name) or f"extra_{number}"
        if name in taken:
            name = f"extra_{field.name}"
            notes.append(f"The extra field '{field.name}' is called '{name}': LAS has one itself.")
        wanted.append(name)
    chosen = distinct(wanted, taken)
    for name, other in zip(wanted, chosen, strict=True):
        if name != other:
            notes.append(f"The name '{name}' is there more than once: the next is '{other}'.")
    return [
        ExtraField(name, f.at, f.dtype, f.no_data, f.scale, f.shift)
        for name, f in zip(chosen, fields, strict=True)
        if name not in LEFT_BY_PDAL
    ]
