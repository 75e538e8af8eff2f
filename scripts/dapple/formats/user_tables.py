"""Tables as loggers, weather services and people write them: read as text, then by column."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dapple.errors import InputError
from dapple.formats import column_names, json_layouts, spreadsheets, table_layouts, table_numbers
from dapple.formats.text_table import Table, build, cells_of, trimmed, uneven
from dapple.formats.units import is_unit

DELIMITERS = ";\t,|"
LIGHT_FLAGS = (
    *(-99.0, -99.9, -99.99, -888.0, -999.0, -999.9, -999.99, -6999.0, -7999.0, -8888.0),
    *(sign * (10.0**digits - rest) for sign in (-1, 1) for digits in (4, 5, 6, 7)
      for rest in (1.0, 0.1, 0.01)),
    *(6999.0, 7999.0, -32768.0, -32767.0, 32767.0, 65535.0, -9999000.0, 1e20, 1e30),
)  # fmt: skip
"""Numbers by which loggers and services mark missing light: none is a light."""

CAMPBELL_BINARY = re.compile(rb'"TOB[123]"')
QUOTED = re.compile(r'"[^"]*"')
HEAD_LINES, MOST_BREAKS = 40, 4
"""Lines at the beginning, and breaks in one quoted cell of them."""


@dataclass(frozen=True)
class Declared:
    """What is declared of a table with times; empty: as the file says, or as its cells show.

    Attributes
    ----------
    time_column : str
        See `time_columns.of`.
    timezone, time_format : str
        See `times.parse`; a column that ends in `_utc`, and some layouts, need no zone.
    interval_label : {"", "instant", "start", "middle", "end"}
        What of its interval a stamp marks; empty: what the layout says, else a moment.
    interval_min : float
        Length of the intervals [min]; 0: the layout's, else the step between rows.
    unit : str
        Of the values; empty: as the header says, else the usual one.
    decimal : {"", ".", ","}
        Decimal sign.
    missing : texts or numbers
        Flags of missing values, besides `LIGHT_FLAGS`.
    """

    time_column: str = ""
    timezone: str = ""
    time_format: str = ""
    interval_label: str = ""
    interval_min: float = 0.0
    unit: str = ""
    decimal: str = ""
    missing: Sequence[str | float] = ()

    @property
    def flags(self) -> tuple[str | float, ...]:
        """All flags of missing values."""
        return (*LIGHT_FLAGS, *self.missing)


def read(path: str | Path, *, decimal: str = "") -> Table:
    """Read a delimited text table of any common layout, or a workbook with one table.

    Encodings (UTF-8 with or without mark, UTF-16, else Windows-1252), delimiters, lines before the
    header, quoted cells and a row of units are recognised, and the layouts in
    `dapple.formats.table_layouts` by name.

    Parameters
    ----------
    path : path
    decimal : {"", ".", ","}
        Decimal sign; empty: as the cells show.

    Raises
    ------
    InputError
        No file, no text, no header, a row with more or fewer cells than the header, or one name
        for two columns.
    """
    path = Path(path)
    if spreadsheets.is_spreadsheet(path):
        rows, sign = spreadsheets.lines(path, decimal)
        lines, decimal = _whole_cells(rows), decimal or sign
    else:
        lines = read_lines(path)
    table = json_layouts.recognise(path, lines) or table_layouts.recognise(path, lines)
    table = table or _with_spans(_plain(path, lines))
    return replace(table, decimal=decimal or table.decimal)


def read_lines(path: Path) -> list[str]:
    """The lines of a text file, whatever common encoding it has."""
    if not path.is_file():
        raise InputError(path, "no file", "a table", "Check the path in the configuration.")
    data = path.read_bytes()
    if CAMPBELL_BINARY.match(data):
        raise InputError(
            path, f"Campbell's binary format {data[1:5].decode()}", "a text table",
            "Convert it to TOA5 with Card Convert, LoggerNet or PC400.",
        )  # fmt: skip
    text = _decoded(data)
    if "\x00" in text:
        raise InputError(path, "a binary file", "a text table", "Export it as CSV.")
    return _whole_cells(re.split(r"\r\n|\r|\n", text.removesuffix("\n")))


def _whole_cells(lines: list[str]) -> list[str]:
    """Cells of a header that go on in the next line put together; numbers of lines are kept."""
    for index in range(min(len(lines), HEAD_LINES)):
        last = index
        while lines[index].count('"') % 2 and last - index < MOST_BREAKS and last + 1 < len(lines):
            last += 1
            lines[index] += " " + lines[last]
            lines[last] = ""
    return lines


def _decoded(data: bytes) -> str:
    """UTF-8, UTF-16 with its mark or without, or Windows-1252."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    for at, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        half = data[at:2000:2]
        if len(half) > 20 and half.count(0) > 0.9 * len(half):
            return data.decode(name, errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def counted(flags: dict[str, int]) -> str:
    """How often each flag of missing values was met, in words."""
    return ", ".join(
        f"{count} × '{text}'" if text else f"{count} empty" for text, count in flags.items()
    )


def _plain(path: Path, lines: Sequence[str]) -> Table:
    """Some lines, a header, perhaps a row of units, then values."""
    delimiter, header = _layout(path, lines)
    names = cells_of(lines[header], delimiter)
    if all(_is_value(name) for name in names if name):
        commented = _commented(lines[:header], delimiter, len(names))
        if commented is not None:
            return build(path, lines, header=commented, delimiter=delimiter, first=header)
        before = [cells_of(line, delimiter) for line in lines[:header] if line.strip()]
        if before and len(before[-1]) > 1:
            raise uneven(path, header + 1, lines[header], len(names), len(before[-1]))
        raise InputError(
            path,
            f"no header: the first line is '{lines[header].strip()[:60]}'",
            "the names of the columns in the first line",
            "Add a line with names.",
        )
    first, units = header + 1, {}
    while first < len(lines) and not lines[first].strip():
        first += 1
    if first < len(lines) and is_unit_row(row := cells_of(lines[first], delimiter)):
        units = {name: unit for name, unit in zip(names, row, strict=False) if unit}
        first += 1
    return build(path, lines, header=header, delimiter=delimiter, first=first, units=units)


def _with_spans(table: Table) -> Table:
    """A table whose rows have a start and an end is stamped with the start."""
    start, end = table.find(column_names.START), table.find(column_names.END)
    if start is None or end is None or table.find(column_names.TIME) not in (None, start, end):
        return table
    return replace(table, known=table.known | {"time": start}, interval_label="start")


def _is_value(cell: str) -> bool:
    """Whether a cell is a number or a time, and so no name of a column."""
    return table_numbers.is_number(cell) or bool(re.match(r"\d{4}-\d\d-\d\d|\d+[.:/]\d+", cell))


def _commented(before: Sequence[str], delimiter: str, width: int) -> int | None:
    """The last comment before the values that names all columns; None: there is none."""
    found = [
        index
        for index, line in enumerate(before)
        if line.startswith("#") and len(cells_of(line.lstrip("# "), delimiter)) == width
    ]
    return found[-1] if found else None


def _layout(path: Path, lines: Sequence[str]) -> tuple[str, int]:
    """Delimiter and index of the header: the first line with as many cells as most have."""
    filled = [
        index for index, line in enumerate(lines) if line.strip() and not line.startswith("#")
    ]
    if not filled:
        raise InputError(path, "an empty file", "a table", "Is the file complete?")
    sample = filled[:200]
    best = (1, -1, "", filled[0])
    for rank, delimiter in enumerate([*DELIMITERS, " "]):
        bare = [QUOTED.sub("quoted", lines[index]) if delimiter != " " else lines[index]
                for index in sample]  # fmt: skip
        counts = [len(trimmed(cells_of(line, delimiter))) for line in bare]
        usual, votes = Counter(counts).most_common(1)[0]
        if usual < 2 or votes < 0.5 * len(counts):
            continue
        fits = [index for index, n in zip(sample, counts, strict=True) if n == usual]
        # White space also cuts "2023-08-10 10:10" in two, a comma "0,5": only if nothing else does.
        score = (2 if delimiter in ";\t|" else 1 if delimiter == "," else 0, -rank)
        best = max(best, (*score, delimiter, fits[0])) if best[2] else (*score, delimiter, fits[0])
    if not best[2]:
        single = len(lines[filled[0]].split()) == 1
        if not single:
            raise InputError(
                path,
                f"no columns that all lines share ('{lines[filled[0]].strip()[:60]}')",
                "cells divided by commas, semicolons, tabs or blanks",
                "Export the table as CSV.",
            )
        return ",", filled[0]
    return best[2], _wider(lines, filled, best[2], best[3])


def _wider(lines: Sequence[str], filled: Sequence[int], delimiter: str, header: int) -> int:
    """The line of names before a line of values whose last cells are empty, or the line itself."""
    place = filled.index(header)
    values = cells_of(lines[header], delimiter)
    if place == 0 or delimiter == " " or not any(map(_is_value, values)):
        return header
    names = trimmed(cells_of(lines[filled[place - 1]], delimiter))
    is_header = len(trimmed(values)) < len(names) <= len(values) and not any(map(_is_value, names))
    return filled[place - 1] if is_header else header


def is_unit_row(row: Sequence[str]) -> bool:
    """Whether a row tells units: no number in it, and a unit of light, time or length."""
    filled = [cell for cell in row if cell]
    if not filled or any(table_numbers.is_number(cell) or ":" in cell for cell in filled):
        return False
    return any(is_unit(cell) for cell in filled)
