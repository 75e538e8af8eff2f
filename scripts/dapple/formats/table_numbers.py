"""Numbers in the cells of a table: decimal signs, thousands, units behind them, missing values."""

import re
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dapple.errors import InputError

MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "missing", "-", "--", "---", "inf",
                     "-inf", "#n/v", "#n/a", "#nv", "#value!", "#wert!", "#div/0!", "#ref!", "?",
                     "*", "m", "/", "//", "///", "\\n", "–", "—", "n.a.", "nd", "n.d.", "k.a.",
                     "nat", "no data", "nodata", "err", "error", ".", "no value", "invalid",
                     "ovrng", "1.#qnan", "-1.#ind", "1.#inf", "#num!", "#null!"})  # fmt: skip
"""Texts that stand for a missing value, in small letters."""

# A sign, digits with separators, an exponent; then, perhaps, a unit.
NUMBER = re.compile(
    r"^(?P<number>[+\-−]?(?:\d[\d.,'’]*|[.,]\d+)(?:[eE][+-]?\d+)?)(?P<unit>\s*[^\d\s.,'’:/-][^\d:]*)?$"
)
FILLED = re.compile(r"\*{2,}|#{2,}")
"""Stars or hashes: a value that did not fit its cell."""
GROUPS = {sign: re.compile(rf"^[+-]?\d{{1,3}}(?:{re.escape(sign)}\d{{3}})+$") for sign in ".,"}


@dataclass(frozen=True)
class Numbers:
    """A column of numbers.

    Attributes
    ----------
    values : (n,) float64
        NaN where missing.
    unit : str
        As the cells or the header have it; "" where neither says.
    missing : dict of str to int
        How often each text stood for a missing value; "" is an empty cell.
    """

    values: np.ndarray
    unit: str
    missing: dict[str, int]


def is_number(cell: str) -> bool:
    """Whether a cell is a number, a unit behind it allowed."""
    return NUMBER.match(_joined(cell)) is not None


def decimal_sign(cells: pd.DataFrame, column: str, where: str) -> str:
    """The decimal sign that the numbers of a column show, or else those of its table.

    "." where nothing speaks against it.

    Raises
    ------
    InputError
        Some cells of the column show a point and others a comma, or all are like 1,234, which may
        be 1.234 or 1234.
    """
    shown, unclear, largest = _shown(cells[column])
    if len(shown) == 2:
        raise InputError(
            where,
            f"numbers with a decimal point ({shown['.']}) and with a decimal comma ({shown[',']})",
            "one decimal sign in the whole column",
            "Write all numbers with a decimal point.",
        )
    if not shown:
        others = {sign for name in cells if name != column for sign in _shown(cells[name])[0]}
        shown = dict.fromkeys(others, "") if len(others) == 1 else {}
    # 998, 999, 1,000: a comma only where a thousand is full.
    if shown or not unclear or ("," in unclear and 0 < largest < 1000):
        return next(iter(shown), ".")
    raise InputError(
        where,
        f"{unclear}, which may be {unclear.replace(',', '.')} or {re.sub('[.,]', '', unclear)}",
        "numbers whose decimal sign can be told",
        'Set `decimal` for this table to "." or ",".',
    )


def _shown(column: pd.Series) -> tuple[dict[str, str], str, int]:
    """Decimal signs by the numbers that show them, a number like 1,234, the largest without."""
    shown: dict[str, str] = {}
    unclear, with_point, largest = "", "", 0
    for text in column.unique():
        match = NUMBER.match(_joined(str(text)))
        if not match:
            continue
        number = re.sub(r"[eE].*|['’]", "", match["number"])
        if not set(number) & {".", ","}:
            largest = max(largest, int(number.lstrip("+-−")))
        elif sign := _sign_of(number):
            shown.setdefault(sign, number)
        elif "," in number:
            unclear = unclear or number
        else:
            with_point = with_point or number
    # 998, 999, 1.000: points of thousands; 0, 5, 1.250: a decimal point.
    if with_point and not shown and 100 <= largest < 1000:
        unclear = unclear or with_point
    return shown, unclear, largest


def parse(
    cells: pd.Series, where: str, *, decimal: str = ".", flags: Collection[str | float] = ()
) -> Numbers:
    """Turn text into numbers.

    Parameters
    ----------
    cells : pandas.Series of str
        Its index is the line of the file.
    where : str
        File and column, for messages.
    decimal : {".", ","}
        Decimal sign; the other one groups thousands.
    flags : texts or numbers
        What stands for a missing value, besides `MISSING`.

    Raises
    ------
    InputError
        A cell that is neither a number nor a flag, named with its line, or two different units.
    """
    texts, codes = np.unique(cells.to_numpy().astype(str), return_inverse=True)
    words = MISSING | {str(flag).strip().lower() for flag in flags}
    marks = [value for flag in flags if (value := plain(str(flag))) is not None]
    values = np.full(len(texts), np.nan)
    is_missing = np.zeros(len(texts), bool)
    units: dict[str, str] = {}
    for k, text in enumerate(texts):
        if text.strip().lower() in words or FILLED.fullmatch(text.strip()):
            is_missing[k] = True
            continue
        match = NUMBER.match(_joined(text))
        value = plain(_with_point(match["number"], decimal)) if match else None
        if match is None or value is None:
            line = cells.index[int(np.flatnonzero(codes == k)[0])]
            raise InputError(
                f"{where}, line {line}",
                f"'{text}'",
                "a number or a flag of missing values",
                "Correct the cell, or declare the text as a flag in `missing`.",
            )
        values[k] = value
        is_missing[k] = value in marks
        if match["unit"]:
            units.setdefault(match["unit"].strip(), text)
    if len(units) > 1:
        raise InputError(
            where, f"cells in different units: {', '.join(units.values())}", "one unit a column",
            "Convert them to one unit.",
        )  # fmt: skip
    values[is_missing] = np.nan
    counts = np.bincount(codes, minlength=len(texts))
    missing = {str(texts[k]): int(counts[k]) for k in np.flatnonzero(is_missing)}
    return Numbers(values[codes], next(iter(units), ""), missing)


def _joined(text: str) -> str:
    """Without blanks between digits, which some write to group thousands."""
    return re.sub(r"(?<=\d)[ \u00a0\u2009\u202f](?=\d{3}(?:\D|$))", "", text.strip())


def _sign_of(number: str) -> str:
    """The decimal sign that one number shows, or "" where it may be either."""
    last = max(number.rfind("."), number.rfind(","))
    sign, other = number[last], "," if number[last] == "." else "."
    if other in number:
        return sign
    if number.count(sign) > 1:  # 1.234.567: groups, and so the other sign divides
        return other if GROUPS[sign].match(number) else ""
    if GROUPS[sign].match(number) and not number.lstrip("+-−").startswith("0"):
        return ""
    return sign


def _with_point(number: str, decimal: str) -> str:
    """A number with a decimal point and without signs between thousands."""
    other = "," if decimal == "." else "."
    head, tail = re.match(r"([^eE]*)(.*)", number).groups()  # type: ignore[union-attr]
    bare = head.replace("'", "").replace("’", "").replace("−", "-")
    whole, _, rest = bare.partition(decimal)
    if other in whole:
        groups = whole.lstrip("+-").split(other)
        if not (1 <= len(groups[0]) <= 3 and all(len(g) == 3 for g in groups[1:])):
            return "no number"
        whole = whole.replace(other, "")
    return f"{whole}.{rest}{tail}" if rest or decimal in bare else f"{whole}{tail}"


def plain(text: str) -> float | None:
    """The number that a text is, or None."""
    try:
        return float(text)
    except ValueError:
        return None
