"""Radiation at any time: between the rows of a table, within the intervals of means, in gaps."""

import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import pvlib
from scipy.interpolate import PchipInterpolator

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.sky import plausible, typical_years
from dapple.sky.radiation_table import Radiation, read
from dapple.sky.sun import (
    Site,
    clear_sky,
    day_of_year,
    direct_diffuse,
    mean_clear_sky,
    position,
)
from dapple.times import utc

Decomposition = Literal["erbs", "dirint"]

LOWEST_SUN_DEG = 7.0
"""Below this elevation a table says nothing of the weather: the model is too uncertain there."""
MOST_OF_CLEAR_SKY = np.array([[1.15], [4.0]])
"""Direct and diffuse radiation over the clear-sky model's that a gap is filled with at most."""
WEATHER_LASTS_MIN = 60.0
"""Into a gap the last row counts less and less, and the median of this span before it more."""


@dataclass(frozen=True)
class Series:
    """Radiation at the wanted times, and how it came about.

    Attributes
    ----------
    values : pandas.DataFrame
        By time (UTC): `global_w_m2`, `diffuse_w_m2`, `modelled` (true where the clear-sky model
        stands in).
    findings : tuple of Finding
    facts : dict
    """

    values: pd.DataFrame
    findings: tuple[Finding, ...] = ()
    facts: dict = field(default_factory=dict)


def broadband(
    times: pd.DatetimeIndex,
    site: Site,
    *,
    kind: str,
    path: str | Path | None = None,
    linke_turbidity: float | None = 3.0,
    max_gap_min: float = 60.0,
    diffuse_model: Decomposition = "erbs",
    implausible: str = "refuse",
    **table: object,
) -> Series:
    """Global and diffuse radiation at the wanted times, modelled or from a file.

    Parameters
    ----------
    times : (t,) DatetimeIndex
        Time-zone aware.
    site : Site
    kind : {"clear_sky", "table"}
        Where they come from.
    path : path
        The file, for "table".
    linke_turbidity, max_gap_min, diffuse_model
        See `at`.
    implausible : {"refuse", "report"}
        What to do with a table whose values cannot be right.
    **table
        Columns, zone, intervals and units of the file: see `radiation_table.read`.

    Raises
    ------
    InputError
        See `radiation_table.read` and `at`; or an implausible table, unless it is only reported.
    """
    if kind == "clear_sky":
        clear = clear_sky(times, site, linke_turbidity=linke_turbidity)
        return Series(clear, facts={"kind": kind})
    measured = read(path, site=site, **table)  # type: ignore[arg-type]
    if typical_years.is_typical(measured.table.index):
        measured = typical_years.in_year_of(measured, times)
    measured = near(measured, times)
    noticed = list(measured.findings)
    doubts = plausible.check(measured, site, linke_turbidity=linke_turbidity)
    if implausible == "refuse":
        findings.stop(doubts)
    noticed += doubts
    found = at(
        measured,
        times,
        site,
        linke_turbidity=linke_turbidity,
        max_gap_min=max_gap_min,
        diffuse_model=diffuse_model,
    )
    noticed += found.findings
    return Series(found.values, tuple(noticed), {"kind": kind, **measured.facts, **found.facts})


def near(radiation: Radiation, times: pd.DatetimeIndex, days: int = 15) -> Radiation:
    """The rows within some days of the wanted times: no others are used or judged.

    Raises
    ------
    InputError
        The table and the times do not overlap.
    """
    times = utc(times)
    index, half = radiation.table.index, pd.Timedelta(minutes=radiation.interval_min)
    if len(times) and (times.max() < index[0] - half or times.min() > index[-1] + half):
        raise InputError(
            radiation.where,
            f"radiation from {index[0]} to {index[-1]}",
            f"an overlap with the times {times.min()} to {times.max()}",
            "Check dates and time zones, or use the clear-sky model.",
        )
    if not len(times):
        return radiation
    span = pd.Timedelta(days=days)
    close = (index >= times.min() - span) & (index <= times.max() + span)
    return replace(radiation, table=radiation.table[close])


def at(
    radiation: Radiation,
    times: pd.DatetimeIndex,
    site: Site,
    *,
    linke_turbidity: float | None = 3.0,
    max_gap_min: float = 60.0,
    diffuse_model: Decomposition = "erbs",
) -> Series:
    """Radiation of a table at the wanted times.

    Samples of a moment are joined by a monotone cubic spline (PCHIP, which does not overshoot).
    A mean over an interval is spread over it with the course of the clear sky, direct and diffuse
    radiation each, so that the mean is kept. Before, after and in gaps of the table the clear-sky
    model stands in, times the ratio of table to model at the nearest rows with the sun higher than
    `LOWEST_SUN_DEG`, at most `MOST_OF_CLEAR_SKY`.

    Parameters
    ----------
    radiation : Radiation
    times : (t,) DatetimeIndex
        Time-zone aware.
    site : Site
    linke_turbidity : float or None
        See `clear_sky`.
    max_gap_min : float
        Samples further apart than this leave a gap [min]; means leave one wherever none is.
    diffuse_model : {"erbs", "dirint"}
        What splits global radiation where diffuse was not measured: Erbs et al. (1982) or DIRINT
        (Perez et al. 1992), through pvlib.

    Raises
    ------
    InputError
        Intervals that overlap.
    """
    times = utc(times)
    measured, noticed = _parts_of(radiation, site, diffuse_model)
    model = direct_diffuse(clear_sky(times, site, linke_turbidity=linke_turbidity))
    sun_zenith = position(times, *site.place)["sun_zenith_deg"].to_numpy()
    if radiation.interval_min:
        clear = mean_clear_sky(radiation.intervals(), site, linke_turbidity=linke_turbidity)
        parts, is_covered = _within_intervals(radiation, times.asi8, measured, clear, model)
    else:
        at_table = clear_sky(radiation.table.index, site, linke_turbidity=linke_turbidity)
        clear = direct_diffuse(at_table)
        parts, is_covered = _between_samples(radiation, times.asi8, measured, max_gap_min)
    middles = radiation.middles()
    is_high = position(middles, *site.place)["sun_zenith_deg"].to_numpy() < 90.0 - LOWEST_SUN_DEG
    if not is_covered.all():
        ratio = _weather(middles.asi8, measured, clear, is_high, times.asi8, is_covered)
        parts = np.where(is_covered, parts, model * ratio)
    parts = np.where(sun_zenith < 90.0, np.maximum(parts, 0.0), 0.0)
    values = pd.DataFrame(
        {
            "global_w_m2": parts.sum(axis=0),
            "diffuse_w_m2": parts[1],
            "modelled": ~is_covered,
        },
        index=times,
    )
    by_day = sun_zenith < 90.0
    modelled = by_day & ~is_covered
    share = float(modelled.sum() / max(by_day.sum(), 1))
    if modelled.any():
        text = (
            f"no radiation at {modelled.sum()} of {by_day.sum()} times with the sun up "
            f"({times[modelled][0]:%Y-%m-%d %H:%M} to {times[modelled][-1]:%H:%M} UTC)"
        )
        remedy = "The clear-sky model stands in, scaled by the nearest rows."
        if not is_high.any():
            remedy = "No row with a high sun tells the weather: a clear sky stands in."
        noticed.append(
            findings.warning(radiation.where, text, "radiation of the whole run", remedy)
        )
    return Series(values, tuple(noticed), {"modelled_share_of_day": share})


def split(radiation: Radiation, site: Site, model: Decomposition = "erbs") -> np.ndarray:
    """Diffuse radiation (n,) of a table's rows from global radiation alone [W m⁻²].

    Erbs et al. (1982) or DIRINT (Perez et al. 1992), through pvlib, with the sun at the middle of
    each interval; all of it is diffuse while the sun is down.
    """
    middles = radiation.middles()
    zenith = position(middles, *site.place)["sun_zenith_deg"].to_numpy()
    total = radiation.table["global_w_m2"].to_numpy()
    if model == "erbs":
        diffuse = pvlib.irradiance.erbs(total, zenith, day_of_year(middles))["dhi"]
    else:
        pressure = pvlib.atmosphere.alt2pres(site.altitude_m)
        with warnings.catch_warnings():
            # pvlib 0.16 still asks pandas for a day of the year by a name that it gives up.
            warnings.simplefilter("ignore", DeprecationWarning)
            beam = pvlib.irradiance.dirint(total, zenith, middles, pressure)
        diffuse = total - np.nan_to_num(beam) * np.cos(np.radians(zenith))
    diffuse = np.where(zenith < 90.0, diffuse, total)
    return np.clip(np.nan_to_num(diffuse, nan=0.0), 0.0, np.maximum(total, 0.0))


def _parts_of(
    radiation: Radiation, site: Site, model: Decomposition
) -> tuple[np.ndarray, list[Finding]]:
    """Direct and diffuse radiation (2, n) of a table's rows, between 0 and global [W m⁻²]."""
    total = np.maximum(radiation.table["global_w_m2"].to_numpy(float), 0.0)
    noticed = []
    if "diffuse_w_m2" in radiation.table:
        diffuse = radiation.table["diffuse_w_m2"].to_numpy(float)
    else:
        diffuse = np.full(len(total), np.nan)
    unknown = np.isnan(diffuse)
    if unknown.any():
        diffuse = np.where(unknown, split(radiation, site, model), diffuse)
        share = "" if unknown.all() else f" in {unknown.sum()} of {len(unknown)} rows"
        noticed.append(
            findings.warning(
                radiation.where, f"no diffuse radiation{share}", "global and diffuse",
                f"It is split by the model `{model}`, which is right on average only.",
            )
        )  # fmt: skip
    diffuse = np.clip(diffuse, 0.0, total)
    return np.stack([total - diffuse, diffuse]), noticed


def _between_samples(
    radiation: Radiation, wanted: np.ndarray, measured: np.ndarray, max_gap_min: float
) -> tuple[np.ndarray, np.ndarray]:
    """Samples joined by a spline (2, t), and where none is too far away (t,)."""
    known = radiation.table.index.asi8
    parts = np.zeros((2, len(wanted)))
    if len(known) == 1:
        is_there = wanted == known[0]
        return np.where(is_there, measured, parts), is_there
    after = np.clip(np.searchsorted(known, wanted), 1, len(known) - 1)
    spanned = (wanted >= known[0]) & (wanted <= known[-1])
    spanned &= (known[after] - known[after - 1] <= max_gap_min * 60e9) | np.isin(wanted, known)
    for k in range(2):
        spline = PchipInterpolator(known.astype(float), measured[k])
        parts[k, spanned] = spline(wanted[spanned].astype(float))
    return parts, spanned


def _within_intervals(
    radiation: Radiation,
    wanted: np.ndarray,
    measured: np.ndarray,
    clear: np.ndarray,
    model: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Means spread over their intervals (2, t), and where there is one (t,)."""
    start, end = radiation.intervals()
    if (overlap := start[1:] < end[:-1] - 10**9).any():
        raise InputError(
            radiation.where,
            f"rows {radiation.step_min:g} min apart that are means of {radiation.interval_min:g} "
            f"min, as at {radiation.table.index[1:][overlap][0]}",
            "intervals that do not overlap",
            "Correct `interval_min`.",
        )
    row = np.searchsorted(start, wanted, side="right") - 1
    is_covered = (row >= 0) & (wanted < end[row.clip(0)])
    row = row.clip(0)
    # Where the model has no sun, or next to none, light is scattered and does not vary.
    is_dark = clear < 1.0
    to_diffuse = np.where(is_dark[0], measured[0], 0.0)
    ratio = np.divide(measured, clear, out=np.zeros_like(clear), where=~is_dark)
    spread = model * ratio[:, row]
    spread[1] += (to_diffuse + np.where(is_dark[1], measured[1], 0.0))[row]
    return spread, is_covered


def _weather(
    known: np.ndarray,
    measured: np.ndarray,
    clear: np.ndarray,
    is_high: np.ndarray,
    wanted: np.ndarray,
    is_covered: np.ndarray,
) -> np.ndarray:
    """Ratio of table to clear sky (2, t) at times that no row covers.

    At the edge of a gap it is the edge's own, and further in the median around the edge, between
    both edges linear in time.
    """
    ratio = np.ones((2, len(wanted)))
    if not is_high.any():
        return ratio
    rows = np.flatnonzero(is_high)
    of_rows = measured[:, rows] / np.maximum(clear[:, rows], 1.0)
    of_rows = np.clip(of_rows, 0.0, MOST_OF_CLEAR_SKY)
    at = known[rows]
    span_ns = WEATHER_LASTS_MIN * 60e9
    missing = np.flatnonzero(~is_covered)
    right = np.searchsorted(at, wanted[missing])
    for k, (moment, side) in enumerate(zip(wanted[missing], right, strict=True)):
        sides, weights = [], []
        for edge, around in (
            (side - 1, (at <= moment) & (at >= at[max(side - 1, 0)] - span_ns)),
            (side, (at >= moment) & (at <= at[min(side, len(at) - 1)] + span_ns)),
        ):
            if not 0 <= edge < len(at):
                continue
            away_ns = abs(int(moment) - int(at[edge]))
            usual = np.median(of_rows[:, around], axis=1)
            own = of_rows[:, edge]
            sides.append(usual + (own - usual) * np.exp(-away_ns / span_ns))
            weights.append(1.0 / max(away_ns, 1))
        ratio[:, missing[k]] = np.average(sides, axis=0, weights=weights)
    return ratio
