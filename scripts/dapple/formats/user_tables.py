"""Tables as loggers, weather services and people write them: read as text, then by column."""

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pandas as pd

from dapple.errors import InputError
from dapple.formats import table_numbers
from dapple.formats.table_numbers import Numbers

DELIMITERS = ";\t,|"
TIME_NAMES = ("time_utc", "time", "timestamp", "datetime", "date_time", "date time", "date/time")
"""Usual names of the column of time stamps."""
LIGHT_FLAGS = (-999.0, -9999.0, -99999.0, -6999.0, -7999.0, -888.0, 7999.0, 6999.0, 9999.0,
               99999.0)  # fmt: skip
"""Numbers by which loggers and services mark missing light: none is a light."""
UNIT_IN_HEADER = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")


@dataclass(frozen=True)
class Table:
    """A table whose cells are still text, with what the file itself says of them.

    Attributes
    ----------
    path : Path
    cells : pandas.DataFrame
        Text, stripped; the index is the line of the file on which a row stands.
    units : dict of str to str
        Unit of a column as its header or a row of units has it.
    layout : str
        `plain`, or the logger or service whose layout the file has.
    timezone : str or None
        Zone of the times where the file names one.
    interval_label : str
        Which end of its interval a time marks where the layout fixes it, else "".
    interval_min : float or None
        Length of the intervals where the layout fixes it [min]; 0: samples of a moment.
    known : dict of str to str
        Columns that a layout fixes: `time`, `global`, `diffuse`, `par`, …
    decimal : str
        Decimal sign of the numbers: "." or ","; "": as the cells show.
    """

    path: Path
    cells: pd.DataFrame
    units: dict[str, str] = field(default_factory=dict)
    layout: str = "plain"
    timezone: str | None = None
    interval_label: str = ""
    interval_min: float | None = None
    known: dict[str, str] = field(default_factory=dict)
    decimal: str = ""

    def find(self, names: Sequence[str]) -> str | None:
        """The first column with one of these names; capitals and a unit behind it do not matter."""
        spelled = {_bare(column): column for column in reversed(self.cells.columns)}
        exact = (name for name in names if name in self.cells)
        loose = (spelled[_bare(name)] for name in names if _bare(name) in spelled)
        return next(exact, None) or next(loose, None)

    def require(self, names: Sequence[str], key: str) -> str:
        """As `find`, or an error that lists the columns and the configuration key.

        Raises
        ------
        InputError
            No such column.
        """
        if (column := self.find(names)) is not None:
            return column
        raise InputError(
            self.path,
            f"columns {', '.join(self.cells.columns)}",
            f"a column {' or '.join(names)}",
            f"Name the column in `{key}`.",
        )

    def text(self, column: str) -> pd.Series:
        """A column as text."""
        return self.cells[column]

    def numbers(self, column: str, flags: Collection[str | float] = ()) -> Numbers:
        """A column as numbers.

        Parameters
        ----------
        column : str
        flags : texts or numbers
            What stands for a missing value besides an empty cell, NAN and the like.

        Raises
        ------
        InputError
            A cell that is neither a number nor a flag, with its line; or numbers whose decimal
            sign cannot be told.
        """
        where = f"{self.path}, column {column!r}"
        decimal = self.decimal or table_numbers.decimal_sign(self.cells, column, where)
        found = table_numbers.parse(self.cells[column], where, decimal=decimal, flags=flags)
        return replace(found, unit=found.unit or self.units.get(column, ""))


def read(path: str | Path, *, decimal: str = "") -> Table:
    """Read a delimited text table of any common layout.

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
    from dapple.formats import table_layouts  # they build tables with this module

    path = Path(path)
    lines = read_lines(path)
    table = table_layouts.recognise(path, lines) or _plain(path, lines)
    return replace(table, decimal=decimal or table.decimal)


def read_lines(path: Path) -> list[str]:
    """The lines of a text file, whatever common encoding it has."""
    if not path.is_file():
        raise InputError(path, "no file", "a table", "Check the path in the configuration.")
    data = path.read_bytes()
    if data[:2] == b"PK" or data[:4] == b"\xd0\xcf\x11\xe0":
        raise InputError(path, "a spreadsheet", "a text table", "Save it as CSV.")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", errors="replace")
    if "\x00" in text:
        raise InputError(path, "a binary file", "a text table", "Export it as CSV.")
    return text.splitlines()


def build(
    path: Path,
    lines: Sequence[str],
    *,
    header: int,
    delimiter: str,
    first: int | None = None,
    **facts: object,
) -> Table:
    """A table from the lines of a file whose header is known.

    Parameters
    ----------
    path : Path
    lines : list of str
    header : int
        Index of the line with the names of the columns.
    delimiter : str
        One character, or " " for any white space.
    first : int or None
        Index of the first line of values; None: the one after the header.
    **facts
        Further attributes of the table.
    """
    names, in_header = _names(path, _cells(lines[header], delimiter), header + 1)
    first = header + 1 if first is None else first
    rows, numbers = [], []
    for number, line in enumerate(lines[first:], start=first + 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = _cells(line, delimiter)
        while len(row) > len(names) and not row[-1]:
            row.pop()
        if len(row) != len(names):
            raise _uneven(path, number, line, len(row), len(names))
        rows.append(row)
        numbers.append(number)
    cells = pd.DataFrame(rows, columns=names, index=pd.Index(numbers, dtype=int), dtype=str)
    units = in_header | dict(facts.pop("units", {}))  # type: ignore[call-overload]
    return Table(path, cells, units=units, **facts)  # type: ignore[arg-type]


def counted(flags: dict[str, int]) -> str:
    """How often each flag of missing values was met, in words."""
    return ", ".join(
        f"{count} × '{text}'" if text else f"{count} empty" for text, count in flags.items()
    )


def _plain(path: Path, lines: Sequence[str]) -> Table:
    """Some lines, a header, perhaps a row of units, then values."""
    delimiter, header = _layout(path, lines)
    names = _cells(lines[header], delimiter)
    if all(table_numbers.is_number(name) for name in names if name):
        before = [_cells(line, delimiter) for line in lines[:header] if line.strip()]
        if before and len(before[-1]) > 1:
            raise _uneven(path, header + 1, lines[header], len(names), len(before[-1]))
        raise InputError(
            path,
            f"no header: the first line is '{lines[header].strip()[:60]}'",
            "the names of the columns in the first line",
            "Add a line with names.",
        )
    first, units = header + 1, {}
    while first < len(lines) and not lines[first].strip():
        first += 1
    if first < len(lines) and is_unit_row(row := _cells(lines[first], delimiter)):
        units = {name: unit for name, unit in zip(names, row, strict=False) if unit}
        first += 1
    return build(path, lines, header=header, delimiter=delimiter, first=first, units=units)


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
        counts = [len(_trimmed(_cells(lines[index], delimiter))) for index in sample]
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
    return best[2], best[3]


def is_unit_row(row: Sequence[str]) -> bool:
    """Whether a row tells units: no number in it, and a unit of light, time or length."""
    from dapple.formats.units import is_unit

    filled = [cell for cell in row if cell]
    if not filled or any(table_numbers.is_number(cell) or ":" in cell for cell in filled):
        return False
    return any(is_unit(cell) for cell in filled)


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.replace('"', "").split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


def _uneven(path: Path, number: int, line: str, found: int, expected: int) -> InputError:
    return InputError(
        f"{path}, line {number}",
        f"{found} cells ('{line.strip()[:60]}')",
        f"{expected}, as the header has",
        "Complete or remove the line; numbers with a comma inside need quotes.",
    )


def _trimmed(row: list[str]) -> list[str]:
    while row and not row[-1]:
        row = row[:-1]
    return row


def _names(path: Path, row: list[str], line: int) -> tuple[list[str], dict[str, str]]:
    """Names of the columns, and the units in brackets behind them."""
    names = [name or f"column_{number}" for number, name in enumerate(_trimmed(row), start=1)]
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise InputError(
            f"{path}, line {line}",
            f"two columns called {repeated[0]}",
            "each name once",
            "Rename one of them.",
        )
    found = {name: UNIT_IN_HEADER.match(name) for name in names}
    in_header = {name: match["unit"].strip() for name, match in found.items() if match}
    return names, {name: unit for name, unit in in_header.items() if not unit.isdigit()}


def _bare(name: str) -> str:
    """A name without its unit, in small letters."""
    match = UNIT_IN_HEADER.match(name)
    return (match["name"] if match else name).strip().lower()
