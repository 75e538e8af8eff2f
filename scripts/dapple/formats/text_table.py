"""A table whose cells are text, and how lines of a file become one."""

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats import column_names, table_numbers, units
from dapple.formats.table_numbers import Numbers

JOINED_TIME = "time"
"""Column that is made of a layout's columns of year, month, day, hour and minute."""
LONGER_THAN_UNITS = 7
"""Words of so many letters that are no known unit are remarks: corrected, station."""
MOST_NAMED = 4
"""Of many usual names, messages list so many."""


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
    repeated : frozenset of str
        Names that several columns have: none of them can be asked for.
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
    repeated: frozenset[str] = frozenset()

    def find(self, names: Sequence[str]) -> str | None:
        """The first column with one of these names, as `column_names.plain` spells both."""
        return column_names.first(names, self.cells.columns)

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
            f"a column {' or '.join(names[:MOST_NAMED])}",
            f"Name the column in `{key}`.",
        )

    def text(self, column: str) -> pd.Series:
        """A column as text.

        Raises
        ------
        InputError
            Several columns have this name.
        """
        if column in self.repeated:
            raise InputError(
                self.path,
                f"two columns called {column}",
                "each name that is used once",
                "Rename one of them.",
            )
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
        found = table_numbers.parse(self.text(column), where, decimal=decimal, flags=flags)
        return replace(found, unit=found.unit or self.units.get(column, ""))

    def column(self, names: Sequence[str], key: str) -> np.ndarray:
        """The numbers of a column that has one in every row.

        Raises
        ------
        InputError
            As `require` and `numbers`, or a row without one.
        """
        name = self.require(names, key)
        values = self.numbers(name).values
        if (empty := ~np.isfinite(values)).any():
            raise InputError(
                f"{self.path}, column {name!r}, line {self.cells.index[empty][0]}",
                "no number",
                "a number in each row",
                "Complete the row or remove it.",
            )
        return values


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
    heads = cells_of(lines[header].lstrip("# "), delimiter)
    names, in_header, repeated = _names(heads)
    first = header + 1 if first is None else first
    rows, numbers = [], []
    for number, line in enumerate(lines[first:], start=first + 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = cells_of(line, delimiter)
        if not any(row):
            continue
        while len(row) > len(names) and not row[-1]:
            row.pop()
        if row == heads:
            continue  # files that were put behind one another
        if len(row) != len(names):
            raise uneven(path, number, line, len(row), len(names))
        rows.append(row)
        numbers.append(number)
    cells = pd.DataFrame(rows, columns=names, index=pd.Index(numbers, dtype=int), dtype=str)
    units = in_header | dict(facts.pop("units", {}))  # type: ignore[call-overload]
    return Table(path, cells, units=units, repeated=repeated, **facts)  # type: ignore[arg-type]


def there(table: Table, **columns: str) -> dict[str, str]:
    """Those of a layout's columns, by role, that a file has."""
    return {role: name for role, name in columns.items() if name in table.cells}


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line, stripped."""
    if delimiter == " ":
        return line.replace('"', "").split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


def uneven(path: Path, number: int, line: str, found: int, expected: int) -> InputError:
    """The error of a row with more or fewer cells than the header."""
    return InputError(
        f"{path}, line {number}",
        f"{found} cells ('{line.strip()[:60]}')",
        f"{expected}, as the header has",
        "Complete or remove the line; numbers with a comma inside need quotes.",
    )


def trimmed(row: list[str]) -> list[str]:
    """A row without the empty cells at its end."""
    while row and not row[-1]:
        row = row[:-1]
    return row


def _names(row: list[str]) -> tuple[list[str], dict[str, str], frozenset[str]]:
    """Names of the columns, the units in brackets behind them, and names that are there twice.

    The second of a name is called after its number, so that a table whose other columns are used
    can be read.
    """
    named = [name or f"column_{number}" for number, name in enumerate(trimmed(row), start=1)]
    repeated = frozenset(name for name, count in Counter(named).items() if count > 1)
    names = [
        name if name not in named[:k] else f"{name} (column {k + 1})"
        for k, name in enumerate(named)
    ]
    found = {name: _unit_of(name) for name in names}
    return names, {name: unit for name, unit in found.items() if unit}, repeated


def _is_remark(text: str) -> bool:
    """Whether what stands in brackets is no unit: a number, a duration, words."""
    words = re.findall(r"[^\W\d_]+", text)
    is_duration = re.fullmatch(r"\d+\s*(?:s|min|mins|minutes?|h|hr|hours?|t)?", text)
    is_prose = bool(words) and re.fullmatch(r"[^\W\d_]+(?:[\s,.-]+[^\W\d_]+)*\.?", text)
    is_word = is_prose and max(map(len, words)) >= LONGER_THAN_UNITS and not units.is_unit(text)
    return bool(is_duration or is_word)


def _unit_of(name: str) -> str:
    """The unit in the name of a column: in brackets, or known and behind a comma or a dash."""
    serial = column_names.SERIAL.search(name)
    if serial and serial["unit"]:
        return serial["unit"].strip()
    name = column_names.SERIAL.sub("", name)
    if match := column_names.UNIT_BEFORE.match(name):
        return match["unit"]
    if match := column_names.UNIT_IN_HEADER.match(name):
        return "" if _is_remark(match["unit"].strip()) else match["unit"].strip()
    match = column_names.UNIT_AT_END.match(name)
    return match["unit"] if match and units.named(match["unit"]) else ""
