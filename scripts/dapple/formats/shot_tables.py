"""Tables of shots as other programs write them: AMAPVox's text, and the pulses of HELIOS++."""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats.cloud_raw import Fired

DIRECTION = ("xdirection", "ydirection", "zdirection")
ORIGIN = ("xorigin", "yorigin", "zorigin")
EMPTY = "emptyshot"
POINTS, PULSES = "_points.xyz", "_pulse.txt"
"""Ends of the names of two files of HELIOS++ that belong together."""
PULSE_INDEX, LEAST_COLUMNS = 7, 8


def is_amapvox(path: Path) -> bool:
    """Whether the first line names directions and ranges."""
    with path.open(encoding="utf-8", errors="replace") as handle:
        names = handle.readline(1 << 16).lower().replace('"', "").split()
    return set(DIRECTION) <= set(names) and any(name.startswith("range") for name in names)


def read_amapvox(path: Path) -> Fired:
    """Read shots as AMAPVox and its R package write them.

    Columns `XDirection`, `YDirection`, `ZDirection`, `Range0`, `Range1`, … (NaN: no return), and,
    where they are there, `XOrigin`, `YOrigin`, `ZOrigin` (else 0) and `EmptyShot`.

    Raises
    ------
    InputError
        A column that is no number, or a direction of no length.
    """
    table = _numbers(path, header=0)
    table.columns = [str(name).lower().strip('"') for name in table.columns]
    direction = table[list(DIRECTION)].to_numpy(float)
    ranges = sorted(
        (name for name in table.columns if re.fullmatch(r"range\d{0,6}", name)),
        key=lambda n: int(n[5:] or 0),
    )
    range_m = np.array(table[ranges], float)
    if EMPTY in table:
        range_m[table[EMPTY].to_numpy(float) > 0] = np.nan
    origin = np.zeros_like(direction)
    if set(ORIGIN) <= set(table.columns):
        origin = table[list(ORIGIN)].to_numpy(float)
    met = np.isfinite(range_m) & (range_m > 0)
    order = np.argsort(np.where(met, range_m, np.inf), axis=1)
    ordered = np.take_along_axis(range_m, order, axis=1)
    counts = met.sum(axis=1)
    kept = np.arange(len(ranges)) < counts[:, None]
    first = np.concatenate([[0], np.cumsum(counts)])
    return Fired(origin, _unit(path, direction), first, ordered[kept])


def pulses_of(path: Path) -> Path | None:
    """The file of pulses beside a file of points of HELIOS++, where there is one."""
    if not path.name.endswith(POINTS):
        return None
    beside = path.with_name(path.name.removesuffix(POINTS) + PULSES)
    return beside if beside.is_file() else None


def read_helios(path: Path) -> Fired:
    """Read points of HELIOS++ and the pulses that made them, which lie beside (`--writePulse`).

    Points: x, y, z, intensity, echo width, return number, number of returns, pulse, and more;
    pulses: origin, direction, time, pulse, and more. Pulses without a point met nothing.

    Raises
    ------
    InputError
        Too few columns, or points of pulses that are not there.
    """
    beside = pulses_of(path)
    if beside is None:
        raise InputError(
            path,
            f"no {PULSES[1:]} beside",
            "the pulses of these points",
            "Simulate with --writePulse.",
        )
    points, pulses = (_numbers(file, header=None).to_numpy(float) for file in (path, beside))
    for file, table in ((path, points), (beside, pulses)):
        if table.shape[1] < LEAST_COLUMNS:
            raise InputError(
                file,
                f"{table.shape[1]} columns",
                f"at least {LEAST_COLUMNS}, of which number {LEAST_COLUMNS} is the pulse",
                "Write points as XYZ, with the pulses, by HELIOS++.",
            )
    order = np.argsort(pulses[:, PULSE_INDEX], kind="stable")
    number = pulses[order, PULSE_INDEX]
    place = np.minimum(np.searchsorted(number, points[:, PULSE_INDEX]), len(number) - 1)
    if len(points) and (number[place] != points[:, PULSE_INDEX]).any():
        raise InputError(
            beside,
            "points of pulses that are not there",
            f"the pulses of {path.name}",
            "Keep both files of one simulation together.",
        )
    shot = order[place]
    range_m = np.linalg.norm(points[:, :3] - pulses[shot, :3], axis=1)
    by_shot = np.lexsort((range_m, shot))
    counts = np.bincount(shot, minlength=len(pulses))
    return Fired(
        pulses[:, :3],
        _unit(beside, pulses[:, 3:6]),
        np.concatenate([[0], np.cumsum(counts)]),
        range_m[by_shot],
        {"RelativeIntensity": points[by_shot, 3].astype(np.float32)},
    )


def _unit(path: Path, direction: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(direction, axis=1)
    bad = ~(length > 0)
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(
            path,
            f"a direction {direction[row].tolist()} in row {row + 1}",
            "directions with a length",
            "Remove the row or write the table again.",
        )
    return direction / length[:, None]


def _numbers(path: Path, header: int | None) -> pd.DataFrame:
    """A table of numbers separated by blanks."""
    try:
        table = pd.read_csv(path, sep=r"\s+", header=header, encoding_errors="replace")
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError) as error:
        said = " ".join(str(error).split())[:150]
        raise InputError(path, said, "a table of numbers", "Write the table again.") from error
    for name in table.columns:
        if table[name].dtype.kind not in "iufb":
            raise InputError(
                path,
                f"text in column {name}",
                "a table of numbers",
                "Remove the text or write the table again.",
            )
    return table
