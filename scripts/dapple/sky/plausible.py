"""Can a radiation table be right? Its unit, its columns and single rows, against physics."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pvlib

from dapple import findings
from dapple.findings import Finding
from dapple.formats import units
from dapple.sky import radiation_clock
from dapple.sky.radiation_table import Radiation
from dapple.sky.sun import Site, clear_sky, extraterrestrial, position

OFFSET_W_M2 = 20.0
"""Thermopiles read a few watts below zero at night."""
MOST_OF_CLEAR_DAY = 1.25
"""A day's energy over that of the clear-sky model: more is no weather."""
LEAST_OF_CLEAR_DAY = 0.75
"""The best day of a table below this may be another unit, if something else says so too."""
DARKEST_DAY, DARKEST_SMOOTH = 0.02, 0.1
"""More of a clear sky arrives under the thickest cloud; and on a day without a ripple."""
UNIT_FITS = (0.55, 1.2)
"""A unit explains a table where the best day is then between these shares of clear sky."""
PAR_UMOL_PER_GLOBAL_J = 2.06
"""Photons of PAR in a joule of global radiation (0.45 of it, 4.57 µmol J⁻¹)."""
LIGHT_W_M2 = 50.0
SUN_HIGH_DEG = 10.0
SUNNY_DIFFUSE, SUNNY_CLEARNESS = 0.25, 0.5
"""Where less than this share is diffuse, more than that share of what is outside arrives."""
LEAST_DIFFUSE = 0.3
"""Diffuse over that of the clear-sky model: the air alone scatters more."""


@dataclass(frozen=True)
class Rows:
    """Rows of a table beside what the sun and a clear sky would give.

    Attributes
    ----------
    total, diffuse : (n,) float64
        Global and diffuse radiation; diffuse NaN where unknown [W m⁻²].
    clear_total, clear_diffuse : (n,) float64
        A clear sky at the middle of each row's interval [W m⁻²].
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


def check(
    radiation: Radiation, site: Site, *, linke_turbidity: float | None = 3.0
) -> list[Finding]:
    """What speaks against a table, the likeliest reason first.

    Parameters
    ----------
    radiation : Radiation
    site : Site
    linke_turbidity : float or None
        Of the clear sky that it is held against; see `sun.clear_sky`.

    Returns
    -------
    list of Finding
        Errors: columns exchanged, another unit, another time, what is physically impossible.
        Warnings: values that are extremely rare.

    Notes
    -----
    Limits of the Baseline Surface Radiation Network: Long and Shi (2008). Days are judged by their
    energy, so that short cloud edges and offsets of sensors at night raise no doubt.
    """
    rows = beside_clear_sky(radiation, site, linke_turbidity)
    off = radiation_clock.offset(radiation, site, linke_turbidity=linke_turbidity)
    wrong_time = radiation_clock.check(radiation, site, off)
    if off is not None and wrong_time is not None and wrong_time.level == "error":
        # Units are judged as if the clock were right: a day that is cut in two is no bright day.
        moved = radiation.table.set_axis(
            radiation.table.index + pd.Timedelta(minutes=off.minutes), axis="index"
        )
        rows = beside_clear_sky(replace(radiation, table=moved), site, linke_turbidity)
    if (exchanged := _exchanged(radiation, rows)) is not None:
        return [exchanged]
    doubts = [
        one
        for one in (
            _unit(radiation, rows),
            wrong_time,
            _diffuse(radiation, rows),
        )
        if one is not None
    ]
    return (
        doubts if any(one.level == "error" for one in doubts) else doubts + _limits(radiation, rows)
    )


def beside_clear_sky(radiation: Radiation, site: Site, linke_turbidity: float | None) -> Rows:
    """Rows of a table beside a clear sky."""
    middles = radiation.middles()
    zenith = position(middles, *site.place)["sun_zenith_deg"].to_numpy()
    ends = pd.DatetimeIndex(pd.to_datetime(radiation.intervals().ravel(), utc=True))
    at_ends = position(ends, *site.place)["sun_zenith_deg"].to_numpy().reshape(2, -1)
    clear = clear_sky(middles, site, linke_turbidity=linke_turbidity)
    total = radiation.table["global_w_m2"].to_numpy(float)
    measured = radiation.table.get("diffuse_w_m2")
    return Rows(
        total,
        np.full(len(total), np.nan) if measured is None else measured.to_numpy(float),
        clear["global_w_m2"].to_numpy(),
        clear["diffuse_w_m2"].to_numpy(),
        90.0 - zenith,
        np.maximum(np.cos(np.radians(np.minimum(zenith, at_ends.min(axis=0)))), 0.0),
        extraterrestrial(middles),
        solar_day(middles, site),
    )


def solar_day(times: pd.DatetimeIndex, site: Site) -> np.ndarray:
    """Number of the day (n,), from midnight to midnight of the mean sun."""
    return np.floor(times.asi8 / 86400e9 + site.longitude_deg / 360.0).astype(int)


def day_ratios(rows: Rows) -> pd.Series:
    """Energy over that of a clear sky, by solar day; days with little sun in the table left out."""
    lit = rows.clear_total > LIGHT_W_M2
    sums = pd.DataFrame({"day": rows.day, "total": rows.total, "clear": rows.clear_total, "n": lit})
    days = sums.groupby("day").sum()
    days = days[days["n"] >= 3]
    return days["total"] / days["clear"]


def unit_factors(step_min: float) -> dict[str, float]:
    """What 1 W m⁻² over a step is in other units; those near 1 cannot be told from it."""
    seconds = 60.0 * step_min
    every = {
        "J/cm2": seconds / 1e4,
        "kJ/m2": seconds / 1e3,
        "MJ/m2": seconds / 1e6,
        "J/m2": seconds,
        "Wh/m2": seconds / 3.6e3,
        "kWh/m2": seconds / 3.6e6,
        "kW/m2": 1e-3,
        "mW/cm2": 0.1,
        "umol/m2/s": PAR_UMOL_PER_GLOBAL_J,
        "lx": units.DAYLIGHT_LM_PER_W,
    }
    return {
        unit: factor
        for unit, factor in every.items()
        if np.isfinite(factor) and abs(np.log(factor)) > 0.2
    }


def _unit(radiation: Radiation, rows: Rows) -> Finding | None:
    """Another unit, where a factor between units explains what no weather does."""
    days = day_ratios(rows)
    if days.empty:
        return None
    best = float(days.max())
    too_bright = best > MOST_OF_CLEAR_DAY
    is_too_direct = best < LEAST_OF_CLEAR_DAY and _is_too_direct(rows)
    smooth = _smooth_days(rows, days) if best < LEAST_OF_CLEAR_DAY else 0
    if not (too_bright or is_too_direct or smooth or best < DARKEST_DAY):
        return None
    # A dim day that runs along with the sun may be evenly overcast, and several may be hazy.
    is_sure = too_bright or is_too_direct or best < DARKEST_SMOOTH or (smooth > 1 and best < 0.5)
    step = radiation.interval_min or radiation.step_min
    low, high = UNIT_FITS
    fitting = {
        unit: abs(np.log(best / factor))
        for unit, factor in unit_factors(step).items()
        if low <= best / factor <= high
    }
    likely = sorted(fitting, key=fitting.__getitem__)
    peak = float(np.nanmax(rows.total))
    found = (
        f"global radiation up to {peak:.4g}, {100 * best:.3g} % of a clear sky's energy on the "
        "best day"
    )
    if not likely and not too_bright:
        return None
    if not likely:
        remedy = "Check unit, calibration, place and date."
    else:
        others = f" (or {' or '.join(likely[1:3])})" if len(likely) > 1 else ""
        over = "" if likely[0] in ("kW/m2", "mW/cm2", "umol/m2/s", "lx") else f" over {step:g} min"
        remedy = f"This fits {likely[0]}{over}{others}: set `radiation.unit: {likely[0]}`."
        if likely[0] == "umol/m2/s":
            remedy = (
                f"This fits PAR in µmol m⁻² s⁻¹{others}, which is not global radiation: give "
                "global radiation, or use the clear-sky model."
            )
    make = findings.error if is_sure else findings.warning
    return make(radiation.where, found, "W m⁻² that some weather can give", remedy)


def _is_too_direct(rows: Rows) -> bool:
    """Whether the sun shines at too little light: rows with little diffuse light are bright.

    At the clearness index that does not depend on the height of the sun (Perez et al. 1990).
    """
    there = (rows.elevation_deg > SUN_HIGH_DEG) & (rows.total > 0) & np.isfinite(rows.diffuse)
    sunny = there & (rows.diffuse < SUNNY_DIFFUSE * rows.total)
    if sunny.sum() < max(4, 0.05 * there.sum()):
        return False
    outside = rows.extraterrestrial[sunny] * np.sin(np.radians(rows.elevation_deg[sunny]))
    clearness = pvlib.irradiance.clearness_index_zenith_independent(
        np.clip(rows.total[sunny] / outside, 0.0, 1.0),
        pvlib.atmosphere.get_relative_airmass(90.0 - rows.elevation_deg[sunny]),
    )
    return bool(np.median(clearness) < SUNNY_CLEARNESS)


def _smooth_days(rows: Rows, days: pd.Series) -> int:
    """How many days run along with a clear sky, as no cloudy one does, at the best day's level.

    0 where the best day does not, or where it has the diffuse light of an overcast day.
    """
    level, count = 0.0, 0
    for day in days.sort_values(ascending=False).index:
        high = (rows.day == day) & (rows.elevation_deg > 15.0)
        ratio = rows.total[high] / rows.clear_total[high]
        if high.sum() < 5 or np.std(ratio) >= 0.02 * np.mean(ratio):
            if not count:
                return 0
            continue
        if np.nanmean(np.append(rows.diffuse[high] / rows.total[high], 0.0)) > 0.45:
            return count
        level = level or float(np.mean(ratio))
        if np.mean(ratio) < 0.95 * level:
            break
        count += 1
    return count


def _exchanged(radiation: Radiation, rows: Rows) -> Finding | None:
    """Diffuse above global most of the day, and plausible the other way round."""
    lit = (np.fmax(rows.total, rows.diffuse) > LIGHT_W_M2) & np.isfinite(rows.diffuse)
    if lit.sum() < 3 or (rows.diffuse[lit] > 1.1 * rows.total[lit]).mean() < 0.5:
        return None
    columns = radiation.facts.get("columns", {})
    names = [columns.get(key, key) for key in ("global_w_m2", "diffuse_w_m2")]
    return findings.error(
        radiation.where,
        "more diffuse than global radiation in "
        f"{100 * (rows.diffuse > rows.total)[lit].mean():.0f} % of rows",
        "diffuse radiation as a part of global",
        f"The columns look exchanged: set `radiation.global_column: {names[1]}` and "
        f"`radiation.diffuse_column: {names[0]}`, or check the unit of each.",
    )


def _diffuse(radiation: Radiation, rows: Rows) -> Finding | None:
    """Diffuse radiation that the air alone exceeds, or of more rows above global than chance."""
    there = (rows.elevation_deg > SUN_HIGH_DEG) & np.isfinite(rows.diffuse)
    if there.sum() < 4:
        return None
    middle = float(np.median(rows.diffuse[there] / np.maximum(rows.clear_diffuse[there], 1.0)))
    # A dark day is dark in diffuse light as well.
    share = float(np.median(rows.total[there] / np.maximum(rows.clear_total[there], 1.0)))
    if middle < LEAST_DIFFUSE and share > LEAST_DIFFUSE:
        return findings.error(
            radiation.where,
            f"diffuse radiation of {100 * middle:.0f} % of a clear sky's (median)",
            f"at least {100 * LEAST_DIFFUSE:.0f} %: clean air alone scatters more",
            "Check the unit of the diffuse column, or leave it out of the file: then a model "
            "splits global radiation.",
        )
    lit = there & (rows.total > LIGHT_W_M2)
    above = rows.diffuse[lit] > 1.1 * rows.total[lit]
    if lit.sum() >= 4 and above.mean() > 0.1:
        return findings.warning(
            radiation.where,
            f"more diffuse than global radiation in {100 * above.mean():.0f} % of rows",
            "diffuse radiation as a part of global",
            "Diffuse is cut at global; check both sensors.",
        )
    return None


def _limits(radiation: Radiation, rows: Rows) -> list[Finding]:
    """Single rows beyond what is physically possible (errors) or extremely rare (warnings)."""
    found = []
    curve = rows.extraterrestrial * rows.cosine**1.2
    for name, values, possible, rare in (
        ("global", rows.total, 1.5 * curve + 100.0, 1.2 * curve + 50.0),
        ("diffuse", rows.diffuse, 0.95 * curve + 50.0, 0.75 * curve + 30.0),
    ):
        known = np.isfinite(values)
        beyond = known & ((values > possible) | (values < -OFFSET_W_M2))
        if beyond.any():
            row = int(np.flatnonzero(beyond)[0])
            found.append(
                findings.error(
                    radiation.where,
                    f"{name} radiation of {values[row]:.4g} W m⁻² at {radiation.table.index[row]} "
                    f"with the sun {rows.elevation_deg[row]:.0f}° high"
                    + (f", and {beyond.sum() - 1} more such rows" if beyond.sum() > 1 else ""),
                    f"{-OFFSET_W_M2:g} to {possible[row]:.4g} W m⁻², the physically possible "
                    "(Long and Shi 2008)",
                    "Check unit, time zone and place; remove the rows if they are faults: gaps "
                    "are filled.",
                )
            )
            continue
        unusual = known & (values > rare)
        if unusual.any():
            row = int(np.flatnonzero(unusual)[0])
            found.append(
                findings.warning(
                    radiation.where,
                    f"{unusual.sum()} of {known.sum()} values of {name} radiation that are "
                    f"extremely rare, first {values[row]:.4g} W m⁻² at "
                    f"{radiation.table.index[row]}",
                    f"at most {rare[row]:.4g} W m⁻² (Long and Shi 2008)",
                    "Edges of clouds give such values for a minute.",
                )
            )
    return found
