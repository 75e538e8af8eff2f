"""Points in PCD files of the Point Cloud Library: ASCII and binary."""

import io
from pathlib import Path

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats.cloud_ply import check_precision
from dapple.formats.cloud_raw import MISSED, RawCloud, Source, attribute_name, columns, distinct

LONGEST_HEADER = 1 << 14
"""Bytes in which the header of a PCD file ends."""
KINDS = {"F": "f", "I": "i", "U": "u"}


def read(path: Path) -> RawCloud:
    """Read points and their fields.

    Points whose coordinates are NaN stand for shots that met nothing, and are left out.

    Raises
    ------
    InputError
        A header that is none or tells of more points than the file holds, values that are no
        numbers, or a compressed file.
    """
    with path.open("rb") as file:
        head = file.read(LONGEST_HEADER)
    facts, begin = _header(head)
    kind, width = facts.get("DATA", [""])[0], _width(path, facts)
    points = int(facts["POINTS"][0])
    if kind not in ("ascii", "binary"):
        raise InputError(
            path, f"DATA {kind}", "ascii or binary",
            "Convert it with `pcl_convert_pcd_ascii_binary in.pcd out.pcd 1`.",
        )  # fmt: skip
    # A value takes a digit and a blank of text at least.
    least = width.itemsize if kind == "binary" else 2 * len(width.names or ())
    held = path.stat().st_size - begin
    unended = 1 if kind == "ascii" else 0  # the last line of text may lack its end
    if points < 0 or points * least > held + unended:
        raise InputError(
            path, f"{points} points in {held:,} bytes", "a file that holds them",
            "Copy or export the file again.",
        )  # fmt: skip
    data = path.read_bytes()[begin:]
    found = np.frombuffer(data, width, points) if kind == "binary" else _text(path, data, width)
    return _raw(path, found)


def _header(head: bytes) -> tuple[dict[str, list[str]], int]:
    """Words by their first one, and where the values begin."""
    facts: dict[str, list[str]] = {}
    begin = 0
    for line in head.splitlines(keepends=True):
        begin += len(line)
        words = line.decode("ascii", "replace").split()
        facts |= {words[0]: words[1:]} if words else {}
        if words[:1] == ["DATA"]:
            break
    return facts, begin


def _width(path: Path, facts: dict[str, list[str]]) -> np.dtype:
    """What a point is made of."""
    try:
        fields, kinds = facts["FIELDS"], facts["TYPE"]
        sizes = [int(word) for word in facts["SIZE"]]
        counts = [int(word) for word in facts.get("COUNT", ["1"] * len(fields))]
        parts = list(zip(fields, kinds, sizes, counts, strict=True))
        int(facts["POINTS"][0]), facts["DATA"][0], [fields.index(axis) for axis in "xyz"]
        columns = [
            (f"{name}_{k}" if count > 1 or name == "_" else name, f"<{KINDS[kind]}{size}")
            for name, kind, size, count in parts
            for k in range(count)
        ]
        names = distinct(name for name, _ in columns)
        return np.dtype([(n, kind) for n, (_, kind) in zip(names, columns, strict=True)])
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError(
            path, f"no header of a PCD file ({error})",
            "FIELDS with x, y and z, SIZE, TYPE, POINTS and DATA",
            "Copy or export the file again.",
        ) from error  # fmt: skip


def _text(path: Path, data: bytes, width: np.dtype) -> np.ndarray:
    """Points (n,) of lines of numbers."""
    names = list(width.names or ())
    try:
        table = pd.read_csv(
            io.BytesIO(data), sep=r"\s+", header=None, names=names, dtype=float, index_col=False
        )
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(
            path, f"values that are no table of numbers ({error})",
            f"{len(names)} numbers in each line", "Copy or export the file again.",
        ) from error  # fmt: skip
    return table.to_records(index=False)


def _raw(path: Path, values: np.ndarray) -> RawCloud:
    xyz = np.column_stack([values[axis].astype(np.float64) for axis in "xyz"])
    check_precision(path, xyz, {axis: values.dtype[axis].str[1:] for axis in "xyz"})
    there = np.isfinite(xyz).all(axis=1)
    missed = int((~there).sum())
    others = [name for name in values.dtype.names or () if name not in "xyz" and name[0] != "_"]
    attributes: dict[str, np.ndarray] = {}
    for name, found in zip(others, distinct(map(attribute_name, others)), strict=True):
        attributes |= columns(found, values[name][there])
    source = Source(len(xyz), left_out={MISSED: missed} if missed else {})
    return RawCloud(xyz[there], attributes=attributes, source=source)
