"""Ways in which a sound file goes wrong: bits, bytes and blocks; words, cells and lines."""

import re
import struct
from collections.abc import Callable

import numpy as np

HEAD = 600
"""Bytes at the start of a binary file that tell of the rest: half of the changes fall here."""
NUMBERS = (0, 1, 2, 7, 127, 128, 255, 256, 32767, 32768, 65535, 1 << 24, (1 << 31) - 1, 1 << 31,
           (1 << 32) - 1, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)  # fmt: skip
WORDS = ("nan", "inf", "-inf", "-999", "1e400", "-1e-400", "1,5", "1.234,5", "1'000", "", "abc",
         "0x10", "٣", "٣٫٥", "−4", "NaN", "NULL", "#", '"', "'", ";", ",", "\t", "\x00", "\ufeff",
         "\u2028", "9" * 400, "1_000", "2023-13-45", "99999999999999999999", "{}", "[", "=1+1",
         "24:00", "0", "-0", "1.", ".5", "+5", "Ünïcödé", "\x1a", "\r")  # fmt: skip


def mutate(data: bytes, is_text: bool, rng: np.random.Generator) -> bytes:
    """One to four changes of a file."""
    for _ in range(int(rng.choice([1, 1, 1, 2, 2, 3, 4]))):
        kinds = TEXT if is_text and rng.random() < 0.8 else BINARY
        data = kinds[rng.integers(len(kinds))](data, rng)
    return data


def _at(data: bytes, rng: np.random.Generator) -> int:
    most = len(data) if rng.random() < 0.5 else min(len(data), HEAD)
    return int(rng.integers(max(most, 1)))


def _bit(data: bytes, rng: np.random.Generator) -> bytes:
    if not data:
        return data
    changed, at = bytearray(data), _at(data, rng)
    changed[at] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _byte(data: bytes, rng: np.random.Generator) -> bytes:
    if not data:
        return data
    changed, at = bytearray(data), _at(data, rng)
    changed[at] = int(rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.integers(256)]))
    return bytes(changed)


def _number(data: bytes, rng: np.random.Generator) -> bytes:
    """A count, an offset or a length that is something else."""
    size = "BHIQ"[rng.integers(4)]
    value = NUMBERS[rng.integers(len(NUMBERS))] % (1 << 8 * struct.calcsize(size))
    packed = struct.pack("<>"[rng.integers(2)] + size, value)
    at = _at(data, rng)
    return data[:at] + packed + data[at + len(packed) :]


def _float(data: bytes, rng: np.random.Generator) -> bytes:
    value = float(rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e300, 1e-310, 1e10]))
    at = _at(data, rng)
    return data[:at] + struct.pack("<d", value) + data[at + 8 :]


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: _at(data, rng)]


def _block(data: bytes, rng: np.random.Generator) -> bytes:
    """A block lost, twice, elsewhere or overwritten."""
    at, length = _at(data, rng), int(rng.integers(1, 65))
    block = data[at : at + length]
    kind = rng.integers(4)
    if kind == 0:
        return data[:at] + data[at + length :]
    if kind == 1:
        return data[:at] + block + data[at:]
    if kind == 2:
        to = _at(data, rng)
        return data[:to] + block + data[to + length :]
    return data[:at] + rng.bytes(length) + data[at + length :]


def _more(data: bytes, rng: np.random.Generator) -> bytes:
    return data + (rng.bytes(200) if rng.random() < 0.5 else data)


def _word(data: bytes, rng: np.random.Generator) -> bytes:
    """A word or a number that is something else."""
    found = list(re.finditer(rb"[^\s,;\"]+", data))
    if not found:
        return data
    one = (
        found[rng.integers(len(found))]
        if rng.random() < 0.7
        else found[rng.integers(20) % len(found)]
    )
    word = WORDS[rng.integers(len(WORDS))].encode("utf-8")
    return data[: one.start()] + word + data[one.end() :]


def _line(data: bytes, rng: np.random.Generator) -> bytes:
    """A line lost, twice, elsewhere, short or split."""
    lines = data.split(b"\n")
    at, kind = int(rng.integers(len(lines))), rng.integers(5)
    if rng.random() < 0.4:
        at = min(at, int(rng.integers(4)))
    line = lines[at]
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(int(rng.integers(len(lines) + 1)), line)
    elif kind == 2:
        lines.insert(int(rng.integers(len(lines))), lines.pop(at))
    elif kind == 3:
        lines[at] = line[: len(line) // 2]
    else:
        lines[at] = line + b";" + line
    return b"\n".join(lines)


def _separator(data: bytes, rng: np.random.Generator) -> bytes:
    one, other = rng.choice([b" ", b",", b";", b"\t", b".", b"\n", b":", b'"'], 2)
    return data.replace(bytes(one), bytes(other), int(rng.choice([-1, 1, 5])))


def _encoded(data: bytes, rng: np.random.Generator) -> bytes:
    text = data.decode("utf-8", errors="replace")
    kind = ("utf-16", "utf-8-sig", "latin-1", "utf-32", "utf-16-be", "cp437")[rng.integers(6)]
    return text.encode(kind, errors="replace")


def _line_ends(data: bytes, rng: np.random.Generator) -> bytes:
    return data.replace(b"\n", (b"\r\n", b"\r", b"\n\n", b"\x0c\n")[rng.integers(4)])


Kind = Callable[[bytes, np.random.Generator], bytes]
BINARY: tuple[Kind, ...] = (_bit, _byte, _number, _number, _float, _cut, _block, _more)
TEXT: tuple[Kind, ...] = (_word, _word, _word, _line, _line, _separator, _encoded, _line_ends)
