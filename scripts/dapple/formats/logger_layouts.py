"""Layouts of loggers with names in several lines: METER and Decagon, Davis."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dapple.formats.text_table import Table, build, cells_of


def meter(path: Path, lines: Sequence[str]) -> Table | None:
    """METER and Decagon: the logger and its ports, sensors, then `W/m² Solar Radiation`."""
    delimiter = "\t" if "\t" in lines[0] else ","
    ports = cells_of(lines[0], delimiter)
    if len(lines) < 4 or len(ports) < 2 or not re.fullmatch(r"Port ?\d+", ports[1]):
        return None
    heads = cells_of(lines[2], delimiter)
    if len(set(heads)) < len(heads):  # sensors of one kind are told apart by their port
        heads = [f"{name} {port}" if k else name
                 for k, (name, port) in enumerate(zip(heads, ports, strict=False))]  # fmt: skip
    named = delimiter.join(f'"{head}"' for head in heads)
    table = build(
        path, [*lines[:2], named, *lines[3:]], header=2, delimiter=delimiter, layout="METER"
    )
    return replace(table, known={"time": str(table.cells.columns[0])})


def davis(path: Path, lines: Sequence[str]) -> Table | None:
    """WeatherLink's text: names in two lines, the second one with Date and Time."""
    if len(lines) < 3 or not re.match(r"\s*Date\tTime\t", lines[1]):
        return None
    upper, lower = (line.split("\t") for line in lines[:2])
    upper += [""] * (len(lower) - len(upper))
    heads = [f"{top.strip()} {name.strip()}".strip()
             for top, name in zip(upper, lower, strict=False)]  # fmt: skip
    # The second of a name is that of another sensor: it keeps its number.
    return build(
        path, [lines[0], "\t".join(heads), *lines[2:]], header=1, delimiter="\t", layout="Davis"
    )
