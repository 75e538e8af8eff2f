"""The radiance of the sky's patches, as a sky scanner or camera measures it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats import user_tables
from dapple.frames import direction_from_angles
from dapple.sky.patches import SUBDIVISIONS, patches
from dapple.times import parse, utc

COLUMNS = ["zenith_deg", "azimuth_deg", "radiance"]


@dataclass(frozen=True)
class MeasuredSky:
    """Relative radiance by patch.

    Attributes
    ----------
    times : (k,) DatetimeIndex or None
        When it was measured, ascending; None: it is the same at all times.
    radiance : (k, p) float64
        Of the patches of a subdivision of the sky, in any unit.
    """

    times: pd.DatetimeIndex | None
    radiance: np.ndarray

    def at(self, times: pd.DatetimeIndex) -> np.ndarray:
        """Radiance (t, p) at other times, linear between those that were measured.

        Raises
        ------
        InputError
            A time before the first or after the last.
        """
        if self.times is None:
            return np.repeat(self.radiance, len(times), axis=0)
        wanted, known = (utc(index).as_unit("ns").asi8 for index in (times, self.times))
        if wanted.min() < known[0] or wanted.max() > known[-1]:
            raise InputError(
                "radiation.sky_table",
                f"a sky from {self.times[0]} to {self.times[-1]}",
                f"one that lasts from {times[0]} to {times[-1]}",
                "Shorten the run, or give one sky for all times, without time_utc.",
            )
        return np.stack([np.interp(wanted, known, column) for column in self.radiance.T], axis=1)


def read(path: str | Path) -> MeasuredSky:
    """Read a table of directions.

    Parameters
    ----------
    path : path
        CSV with `zenith_deg`, `azimuth_deg` (clockwise from north), `radiance` in any unit and,
        where the sky changes, `time_utc`.

    Returns
    -------
    MeasuredSky
        On the finest subdivision (145, 577 or 2305 patches) of which every patch has a direction
        at every time; several in one are averaged.

    Raises
    ------
    InputError
        Columns are missing, a radiance is negative or no number, or the sky has holes.
    """
    table = user_tables.read(path)
    zenith, azimuth, radiance = (table.column([name], "radiation.sky_table") for name in COLUMNS)
    if (wrong := radiance < 0).any():
        raise InputError(
            f"{path}, line {table.cells.index[wrong][0]}", f"a radiance of {radiance[wrong][0]:g}",
            "0 or more", "Correct or remove the row.",
        )  # fmt: skip
    times = None
    moment = np.zeros(len(radiance), int)
    if column := table.find(["time_utc"]):
        stamps = parse(table.text(column).rename("time_utc"), path)
        moment, found = pd.factorize(stamps, sort=True)
        times = pd.DatetimeIndex(found)
    direction = direction_from_angles(zenith, azimuth)
    up = direction[:, 2] >= 0
    direction, moment, radiance = direction[up], moment[up], radiance[up]
    n_times = 1 if times is None else len(times)
    for n in sorted(SUBDIVISIONS, reverse=True)[:-1]:
        cell = moment * n + patches(n).index(direction)
        number = np.bincount(cell, minlength=n_times * n)
        if number.all():
            total = np.bincount(cell, radiance, n_times * n)
            return MeasuredSky(times, (total / number).reshape(n_times, n))
    raise InputError(
        path, f"{(number == 0).sum()} of {n_times * n} patches without a direction",
        "at least one direction in each of 145 patches (Tregenza) at each time",
        "Fill the holes, as around the sun, from their neighbours.",
    )  # fmt: skip
