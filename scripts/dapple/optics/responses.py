"""Responses of light sensors, by name or from a table: how much light counts from where.

A response is pairs of an angle from the normal of the sensor, which looks up, and the response
there over that at the normal: from 0 to 90 degrees, between two angles linear in the cosine of the
angle. Light from below the plane of the sensor does not count. `dapple.optics.sensor_response` says
what follows. No import here needs numpy: the configuration takes the names from this module.
"""

import csv
import itertools
import math
from pathlib import Path

from dapple.errors import InputError

Response = tuple[tuple[float, float], ...]

COSINE: Response = ((0.0, 1.0), (90.0, 0.0))
"""Flux through a level plane."""
NAMED: dict[str, Response] = {
    "cosine": COSINE,
    # Scalar irradiance of the upper hemisphere: light counts 1 wherever it comes from.
    "hemispherical": ((0.0, 1.0), (90.0, 1.0)),
}
COLUMNS = ("angle_deg", "response")


def read(path: str | Path) -> Response:
    """Read the response of a sensor as it was measured.

    Parameters
    ----------
    path : path
        CSV with `angle_deg` from the normal, from 0 to 90 in ascending order, and `response` in any
        unit.

    Returns
    -------
    tuple of (float, float)
        Response over that at the normal: a sensor reads light from above right.

    Raises
    ------
    InputError
        Another file; angles that do not ascend from 0 to 90; a response that is not positive, but
        for 0 at 90 degrees.
    """
    rows = _rows(path)
    angles, values = zip(*rows, strict=True) if rows else ((), ())
    steps = itertools.pairwise(angles)
    if angles[:1] != (0.0,) or angles[-1] != 90.0 or any(b <= a for a, b in steps):
        raise InputError(
            path,
            f"angles {', '.join(f'{angle:g}' for angle in angles) or 'of no row'}",
            "from 0 to 90 degrees, ascending",
            "Add or sort the rows.",
        )
    if not all(0 < value < math.inf for value in values[:-1]) or not 0 <= values[-1] < math.inf:
        raise InputError(
            path,
            f"responses {', '.join(f'{value:g}' for value in values)}",
            "all positive; 0 only at 90 degrees",
            "Leave out rows of no light, or write a small number.",
        )
    return tuple((angle, value / values[0]) for angle, value in rows)


def _rows(path: str | Path) -> list[list[float]]:
    """Angle and response of every row."""
    expected = "a CSV with numbers in the columns angle_deg and response"
    rows = []
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            table = csv.DictReader(file)
            if lacking := [name for name in COLUMNS if name not in (table.fieldnames or ())]:
                remedy = "Name the columns so in the first line, with a comma between them."
                raise InputError(path, f"no column {' and no '.join(lacking)}", expected, remedy)
            for row in table:
                try:
                    rows.append([float(row[name]) for name in COLUMNS])
                except (TypeError, ValueError):
                    found = ", ".join(str(row[name] or "nothing") for name in COLUMNS)
                    raise InputError(
                        f"{path}, line {table.line_num}", found, expected, "Correct the line."
                    ) from None
    except UnicodeDecodeError as error:
        raise InputError(path, f"no text ({error})", expected, "Save it as UTF-8.") from error
    return rows
