"""Rows of a radiation table beside a clear sky."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from dapple.sky.radiation_table import Radiation
from dapple.sky.sun import Site, extraterrestrial, mean_clear_sky, position

MOST_OF_A_DAY = 0.5
"""Of the clear-sky energy of the fullest day in a table."""
LIGHT_W_M2 = 50.0
CLEAR_SAMPLE_MIN = 5.0
"""Step at which the clear sky is averaged over a row's interval."""
SUN_HIGH_DEG = 10.0


@dataclass(frozen=True)
class Rows:
    """Rows of a table beside what the sun and a clear sky would give.

    Attributes
    ----------
    total, diffuse : (n,) float64
        Global and diffuse radiation; diffuse NaN where unknown [W m⁻²].
    clear_total, clear_diffuse : (n,) float64
        A clear sky, as a mean over each row's interval [W m⁻²].
    elevation_deg : (n,) float64
        Of the sun, at the middle.
    cosine : (n,) float64
        Largest cosine of the zenith angle within the interval, 0 or more.
    extraterrestrial : (n,) float64
        On a plane that faces the sun [W m⁻²].
    day : (n,) int
        Number of the solar day.
    """

    total: np.ndarray
    diffuse: np.ndarray
    clear_total: np.ndarray
    clear_diffuse: np.ndarray
    elevation_deg: np.ndarray
    cosine: np.ndarray
    extraterrestrial: np.ndarray
    day: np.ndarray


def beside_clear_sky(radiation: Radiation, site: Site, linke_turbidity: float | None) -> Rows:
    """Rows of a table beside a clear sky."""
    middles = radiation.middles()
    zenith = position(middles, *site.place)["sun_zenith_deg"].to_numpy()
    ends = pd.DatetimeIndex(pd.to_datetime(radiation.intervals().ravel(), utc=True))
    at_ends = position(ends, *site.place)["sun_zenith_deg"].to_numpy().reshape(2, -1)
    beam, diffuse = mean_clear_sky(
        radiation.intervals(), site, linke_turbidity=linke_turbidity, sample_min=CLEAR_SAMPLE_MIN
    )
    total = radiation.table["global_w_m2"].to_numpy(float)
    measured = radiation.table.get("diffuse_w_m2")
    return Rows(
        total,
        np.full(len(total), np.nan) if measured is None else measured.to_numpy(float),
        beam + diffuse,
        diffuse,
        90.0 - zenith,
        np.maximum(np.cos(np.radians(np.minimum(zenith, at_ends.min(axis=0)))), 0.0),
        extraterrestrial(middles),
        solar_day(middles, site),
    )


def solar_day(times: pd.DatetimeIndex, site: Site) -> np.ndarray:
    """Number of the day (n,), from midnight to midnight of the mean sun."""
    return np.floor(times.asi8 / 86400e9 + site.longitude_deg / 360.0).astype(int)


def day_ratios(rows: Rows) -> pd.Series:
    """Energy over that of a clear sky, by solar day; days with little sun in the table left out.

    Of a day that is cut off a wrong clock leaves other hours than those of its sun.
    """
    lit = rows.clear_total > LIGHT_W_M2
    sums = pd.DataFrame({"day": rows.day, "total": rows.total, "clear": rows.clear_total, "n": lit})
    days = sums.groupby("day").sum()
    days = days[(days["n"] >= 3) & (days["clear"] >= MOST_OF_A_DAY * days["clear"].max())]
    return days["total"] / days["clear"]
