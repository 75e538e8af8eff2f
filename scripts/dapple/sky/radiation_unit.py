"""The unit of global radiation: what no weather gives, and which unit explains it."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pvlib

from dapple import findings
from dapple.findings import Finding
from dapple.formats import units
from dapple.sky import clear_hours
from dapple.sky.clear_hours import ClearLevel
from dapple.sky.radiation_rows import SUN_HIGH_DEG, Rows, day_ratios
from dapple.sky.radiation_table import Radiation

MOST_OF_CLEAR_DAY = 1.25
"""A day's energy over that of the clear-sky model: more is no weather."""
MOST_OF_CLEAR_HOUR, NEAR_NOON = 1.6, 0.8
"""An hour's energy over that of the clear-sky model: no clouds reflect so much for so long. Hours
count whose sun is nearly as high as the day's highest (cosines), so that no clock feigns them."""
LEAST_OF_CLEAR_DAY = 0.75
"""The best day of a table below this may be another unit, if something else says so too."""
SURELY_NO_HAZE = 0.5
"""Clear hours below this are of another unit; haze does not take so much from all of them."""
TOO_FEW, TO_CHECK = "too few clear hours", "to check the unit of global radiation"
ASSUMED = "W/m2 (assumed)"
DARKEST_DAY, DARKEST_SMOOTH = 0.02, 0.1
"""More of a clear sky arrives under the thickest cloud; and on a day without a ripple."""
UNIT_FITS = (0.55, 1.2)
"""A unit explains a table where the best day is then between these shares of clear sky."""
UNIT_MAY_FIT = (0.25, 1.2)
"""The same where no hour is known to be clear."""
PAR_UMOL_PER_GLOBAL_J = 2.06
"""Photons of PAR in a joule of global radiation (0.45 of it, 4.57 µmol J⁻¹)."""
SUNNY_DIFFUSE, SUNNY_CLEARNESS = 0.25, 0.5
"""Where less than this share is diffuse, more than that share of what is outside arrives."""


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


def clear_level(radiation: Radiation, rows: Rows) -> ClearLevel | None:
    """The level of a table's clear hours, None where clouds or a low sun hide it."""
    ratio = rows.total / np.maximum(rows.clear_total, 1.0)
    return clear_hours.level(ratio, rows.elevation_deg, rows.day, radiation.step_min)


def untold(radiation: Radiation, rows: Rows) -> Finding:
    """That nothing in a table tells its unit: a warning where nobody else does."""
    column = radiation.facts.get("columns", {}).get("global_w_m2", "")
    stated = radiation.facts.get("units", {}).get(column, ASSUMED)
    is_low = rows.elevation_deg.max() <= clear_hours.SUN_DEG
    why = f"a sun never above {clear_hours.SUN_DEG:g}°" if is_low else TOO_FEW
    found = f"{why} {TO_CHECK} against a clear sky: {stated}"
    if stated != ASSUMED:
        return findings.note(radiation.where, found)
    remedy = "Declare it as `radiation.unit`; brighter days in the same table would tell it too."
    return findings.warning(radiation.where, found, "a unit that somebody says", remedy)


def check(radiation: Radiation, rows: Rows, clear: ClearLevel | None) -> Finding | None:
    """Another unit, where a factor between units explains what no weather does."""
    odd = _odd_energy(radiation, rows, clear)
    if odd is None:
        return None
    step = radiation.interval_min or radiation.step_min
    low, high = UNIT_FITS if clear is not None else UNIT_MAY_FIT
    fitting = {
        unit: abs(np.log(odd.ratio / factor))
        for unit, factor in unit_factors(step).items()
        if low <= odd.ratio / factor <= high
    }
    likely = sorted(fitting, key=fitting.__getitem__)
    if not likely and odd.ratio < 1.0:
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
    make = findings.error if odd.is_sure else findings.warning
    return make(
        radiation.where,
        f"global radiation up to {float(np.nanmax(rows.total)):.4g}, {100 * odd.ratio:.3g} % of a "
        f"clear sky's energy {odd.when}",
        "W m⁻² that some weather can give",
        remedy,
    )


@dataclass(frozen=True)
class _Odd:
    """Energy over that of a clear sky that no weather gives, when, and whether that is sure."""

    ratio: float
    when: str
    is_sure: bool


def _odd_energy(radiation: Radiation, rows: Rows, clear: ClearLevel | None) -> _Odd | None:
    """Energy that no weather gives: of the best day, of an hour, or of all clear hours."""
    days = day_ratios(rows)
    # Where clear hours are as bright as they should be, a day beyond them is a fault of its rows.
    is_right = clear is not None and LEAST_OF_CLEAR_DAY < clear.ratio < MOST_OF_CLEAR_DAY
    if days.empty or is_right:
        return None
    best = float(days.max())
    if best > MOST_OF_CLEAR_DAY:
        return _Odd(best, "on the best day", True)
    hour = _brightest_hour(rows, radiation.step_min)
    if hour > MOST_OF_CLEAR_HOUR:
        return _Odd(hour, "in the brightest hour", True)
    if best >= LEAST_OF_CLEAR_DAY:
        return None
    # Clouds do not return to one level; haze may, but hardly takes half of the light.
    if clear is not None and clear.days >= clear_hours.DAYS and clear.ratio < LEAST_OF_CLEAR_DAY:
        return _Odd(clear.ratio, "in clear hours", clear.ratio < SURELY_NO_HAZE)
    if _is_too_direct(rows):
        return _Odd(best, "on the best day", True)
    # A dim day that runs along with the sun may be evenly overcast, and several may be hazy.
    smooth = _smooth_days(rows, days)
    if smooth or best < DARKEST_DAY:
        is_sure = best < DARKEST_SMOOTH or (smooth > 1 and best < SURELY_NO_HAZE)
        return _Odd(best, "on the best day", is_sure)
    return None


def _brightest_hour(rows: Rows, step_min: float) -> float:
    """The most energy of an hour near noon, over that of a clear sky; 0 where there is none."""
    highest = pd.Series(rows.cosine).groupby(rows.day).transform("max").to_numpy()
    near = (rows.cosine > NEAR_NOON * highest) & (rows.elevation_deg > SUN_HIGH_DEG)
    length = max(1, round(60.0 / step_min)) if step_min > 0 else 1
    if near.sum() < length:
        return 0.0
    sums = np.lib.stride_tricks.sliding_window_view
    total = sums(np.where(near, rows.total, np.nan), length).sum(axis=1)
    ratio = total / np.maximum(sums(rows.clear_total, length).sum(axis=1), 1.0)
    same_day = rows.day[: len(ratio)] == rows.day[length - 1 :]
    return float(np.max(ratio[same_day & np.isfinite(ratio)], initial=0.0))


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
