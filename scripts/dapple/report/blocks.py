"""What a report is made of: sections of texts, tables, figures and charts, without any HTML."""

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pandas as pd

from dapple.report.quantities import Quantity, quantity

EMPTY = "–"
"""Stands where nothing is known."""
LEAST = 1e-4
"""Smaller numbers are not told apart."""
MOST_ROWS = 25
"""Longer tables are folded."""
NAMES = ("reconstruction", "step")
"""Columns of names that the project gave, unlike labels of the input."""


@dataclass(frozen=True)
class Cell:
    """A value as a person reads it, and by what it is sorted."""

    text: str
    key: float | str
    is_number: bool = False


@dataclass(frozen=True)
class Text:
    """Paragraphs."""

    paragraphs: Sequence[str]
    kind: str = "text"


@dataclass(frozen=True)
class Listing:
    """Terms, each with what is to be said of it; a term may be empty."""

    items: Sequence[tuple[str, str]]
    kind: str = "listing"


@dataclass(frozen=True)
class Code:
    """Text as it stands in a file."""

    text: str
    label: str
    kind: str = "code"


@dataclass(frozen=True)
class Table:
    """Rows under quantities that say what they are."""

    title: str
    columns: Sequence[Quantity]
    rows: Sequence[Sequence[Cell]]
    note: str = ""
    kind: str = "table"

    @property
    def is_folded(self) -> bool:
        """Whether it is so long that only its title is shown until it is asked for."""
        return len(self.rows) > MOST_ROWS


@dataclass(frozen=True)
class Picture:
    """A figure as an image within the page."""

    source: str
    caption: str
    kind: str = "picture"


@dataclass(frozen=True)
class Chart:
    """Something to explore, drawn by the function of `templates/page.js` that is called `drawn_by`.

    Attributes
    ----------
    name : str
        Of the element.
    drawn_by : str
    caption : str
        What it shows, also for those who cannot see it.
    data : mapping
        What the function draws: plain values, or arrays as `packed` gives them.
    """

    name: str
    drawn_by: str
    caption: str
    data: Mapping[str, Any]
    kind: str = "chart"


@dataclass(frozen=True)
class Verdict:
    """How far one reconstruction can be trusted, and why."""

    name: str
    state: str
    says: str
    score: str
    reasons: Sequence[str]
    kind: str = "verdict"


Block = Text | Listing | Code | Table | Picture | Chart | Verdict


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it; a folded one is opened by who wants to see it."""

    title: str
    blocks: Sequence[Block] = field(default_factory=tuple)
    is_folded: bool = False


def picture(path: Path, caption: str) -> Picture:
    """An image file as part of the page."""
    data = base64.b64encode(path.read_bytes()).decode()
    return Picture(f"data:image/png;base64,{data}", caption)


def table(
    frame: pd.DataFrame,
    title: str,
    *,
    note: str = "",
    named: Callable[[str], str] = str,
    also: Mapping[str, Quantity] = MappingProxyType({}),
) -> Table:
    """A data frame as a table of the report.

    Parameters
    ----------
    frame : DataFrame
        Columns are known to `quantities`, or shown by their own name.
    title : str
    note : str
        What stands below.
    named : callable
        How names of reconstructions and steps are written.
    also : mapping of str to Quantity
        Columns that mean something else in this table than in others.
    """
    columns = [also.get(str(name)) or quantity(str(name)) for name in frame]
    counts = [_is_count(frame[name]) for name in frame]
    rows = [
        [
            cell(value, 0 if is_count else about.digits, named if name in NAMES else str)
            for name, value, about, is_count in zip(frame, row, columns, counts, strict=True)
        ]
        for row in frame.itertuples(index=False, name=None)
    ]
    return Table(title, columns, rows, note)


def _is_count(column: pd.Series) -> bool:
    """Whether a column holds whole numbers alone, as counts do."""
    numbers = pd.to_numeric(column, errors="coerce").dropna()
    return bool(len(numbers)) and bool((numbers % 1 == 0).all())


def cell(value: Any, digits: int = 3, named: Callable[[str], str] = str) -> Cell:
    """A value as text, numbers with so many significant digits; none: whole numbers."""
    if isinstance(value, bool) or str(value) in ("True", "False"):
        return Cell("yes" if str(value) == "True" else "no", str(value))
    if isinstance(value, str):
        return Cell(named(value), value)
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return Cell(EMPTY, -math.inf if value is None or value != value else value, True)
    return Cell(number(float(value), digits), float(value), True)


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, all those before the point, a true minus sign.

    What is nearer to 0 than `LEAST` is said to be so.
    """
    if digits == 0:
        return f"{value:,.0f}".replace(",", "\u202f").replace("-", "−")
    if value == 0:
        return "0"
    if abs(value) < LEAST:
        return f"< {LEAST:.4f}" if value > 0 else f"> −{LEAST:.4f}"
    magnitude = int(f"{value:.{digits - 1}e}".split("e")[1])
    places = max(digits - 1 - magnitude, 0)
    return f"{round(value, places):,.{places}f}".replace(",", "\u202f").replace("-", "−")
