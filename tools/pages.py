"""Fill the pages' numbers and tables in from the tables in docs/data.

    python tools/pages.py            # rewrite README.md and docs/*.md (part of `make docs`)
    python tools/pages.py --check    # change nothing; list what differs and fail if anything does

A number in a sentence is followed by a comment that says where it stands: table, row, column,
and a factor where the page's unit is another one.

    r is 0.93<!-- contributions[full model].r --> for 57 %<!-- 100*cost[advised].share -->

A row is named by the values of the table's first columns: `[larch, robust]`. The number keeps the
digits, the sign and the commas with which the page writes it.

A block fills in whole lines. Between `<!-- lines` and `-->` stand the lines as the page shows them,
with `{table[row].column:.2f}` for numbers; a line that begins with `table: ` or `table[row]: ` is
written once for every row of the table, or every row that starts with these values, and names
columns alone. The lines below the comment, up to the next empty one, are replaced.

    <!-- lines
    | reconstruction | r | RMSE |
    |---|---|---|
    default_run: | {reconstruction} | {r:.3f} | {rmse:.0f} |
    -->

`docs/data/README.md` tells which command makes which table.
"""

import argparse
import csv
import re
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"

_REFERENCE = r"(?P<table>\w+)\[(?P<row>[^\]\n]+)\]\.(?P<column>\w+)"
_MARK = re.compile(
    r"(?P<number>[-+]?\d[\d,]*(?:\.\d+)?)(?P<unit>[^\d<\n]{0,25})"
    rf"<!--\s*(?:(?P<factor>[\d.]+)\*)?{_REFERENCE}\s*-->"
)
_BLOCK = re.compile(r"<!-- lines\n(?P<template>.*?)\n-->\n(?P<lines>(?:[^\n]+\n)*)", re.DOTALL)
_FIELD = re.compile(rf"\{{(?:{_REFERENCE}|(?P<name>\w+))(?::(?P<form>[^}}]*))?\}}")
_REPEATED = re.compile(r"(?P<table>\w+)(?:\[(?P<row>[^\]]+)\])?: (?P<line>.*)")


class PageError(Exception):
    """A page asks for a number that the tables do not have."""


@cache
def read(folder: Path, table: str) -> list[dict[str, str]]:
    """Rows of a table, as text."""
    path = folder / f"{table}.csv"
    if not path.is_file():
        raise PageError(f"no table {path}")
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def find(folder: Path, table: str, row: str | None) -> list[dict[str, str]]:
    """The rows whose first columns have the values of `row` (joined by commas)."""
    wanted = [] if row is None else [part.strip() for part in row.split(",")]
    return [r for r in read(folder, table) if [*r.values()][: len(wanted)] == wanted]


def value(folder: Path, table: str, row: str, column: str) -> str:
    """One cell, as text; exactly one row must have it."""
    rows = find(folder, table, row)
    if len(rows) != 1:
        raise PageError(f"{len(rows)} rows [{row}] in {table}.csv, one expected")
    if column not in rows[0]:
        raise PageError(f"no column `{column}` in {table}.csv, which has {', '.join(rows[0])}")
    return rows[0][column]


def written_like(number: float, example: str) -> str:
    """A number with the digits, sign and commas of an example."""
    decimals = len(example.partition(".")[2])
    sign = "+" if example.startswith("+") else ""
    comma = "," if "," in example or abs(number) >= 1e4 else ""
    text = f"{number:{sign}{comma}.{decimals}f}"
    return text.lstrip("-") if float(text.replace(",", "")) == 0 else text


def fill(text: str, folder: Path = DATA) -> str:
    """A page with every marked number and block as the tables have it.

    Raises
    ------
    PageError
        A table, row or column that is not there.
    """

    def number(match: re.Match) -> str:
        found = value(folder, match["table"], match["row"], match["column"])
        new = written_like(float(found) * float(match["factor"] or 1), match["number"])
        return new + match[0][len(match["number"]) :]

    def lines(match: re.Match) -> str:
        made = []
        for line in match["template"].split("\n"):
            if repeated := _REPEATED.fullmatch(line):
                rows = find(folder, repeated["table"], repeated["row"])
                if not rows:
                    raise PageError(f"no row for `{line}`")
                made += [_formatted(repeated["line"], folder, row) for row in rows]
            else:
                made.append(_formatted(line, folder, {}))
        return f"<!-- lines\n{match['template']}\n-->\n" + "".join(f"{line}\n" for line in made)

    return _MARK.sub(number, _BLOCK.sub(lines, text))


def _formatted(line: str, folder: Path, row: dict[str, str]) -> str:
    """A line of a block with its fields filled in."""

    def field(match: re.Match) -> str:
        if match["name"] is None:
            found = value(folder, match["table"], match["row"], match["column"])
        elif match["name"] in row:
            found = row[match["name"]]
        else:
            raise PageError(f"no column `{match['name']}` for `{line}`")
        if not match["form"]:
            return found
        return "" if found == "" else format(float(found), match["form"])

    return _FIELD.sub(field, line)


def pages() -> list[Path]:
    """README and the pages of docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing, fail on differences")
    check = parser.parse_args().check
    stale = False
    for page in pages():
        before = page.read_text()
        try:
            after = fill(before)
        except PageError as error:
            sys.exit(f"{page.relative_to(ROOT)}: {error}")
        if before != after:
            stale = True
            for old, new in zip(before.splitlines(), after.splitlines(), strict=False):
                if old != new:
                    print(f"{page.relative_to(ROOT)}:\n- {old}\n+ {new}")
            if not check:
                page.write_text(after)
    if stale and check:
        sys.exit("Numbers differ from docs/data: run `make docs`.")


if __name__ == "__main__":
    main()
