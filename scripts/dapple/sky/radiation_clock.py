"""What a radiation table says of its own clock: a clear sky is symmetric about solar noon."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd
import pvlib

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.sky.radiation_table import Radiation
from dapple.sky.sun import Site, clear_sky, day_of_year, position
from dapple.times import AHEAD
from dapple.timezones import find_timezone

REACH_MIN = 750
COARSE_MIN, FINE_MIN = 10.0, 1.0
"""Offsets that are tried: far and wide first, then around the best [min]."""
CURVE_STEP_MIN = 3.0
"""Step of the clear days that rows are held against."""
MOST_DAYS = 6
"""So many of the brightest days are looked at."""
CLEAR_RESIDUAL = 0.02
"""A day is clear where a clear sky fits it within this share of its light."""
OFFSET_OF_RESIDUAL_MIN = 250.0
"""Offset that what is left of a day may feign: a day of 1 % cloud moves by 2 to 3 min."""
SURE = 25.0
"""How much more badly no offset has to fit, times the residual's variance of one row."""
CUT_ANEW_MIN = 120.0
LIGHT_W_M2 = 20.0
FIRST_LIGHT_W_M2 = 5.0
READ_AS = {
    "instant": "as samples of the moment",
    "start": "as means from their stamp on",
    "middle": "as means around their stamp",
    "end": "as means up to their stamp",
}


@dataclass(frozen=True)
class ClockOffset:
    """How far the true time lies behind a table's times.

    Attributes
    ----------
    minutes : float
        To be added to the assumed middles of the intervals [min].
    days : int
        Clear days that say so.
    error_min : float
        How far off it may be: the days were clear only so far [min].
    """

    minutes: float
    days: int
    error_min: float = 0.0


def offset(
    radiation: Radiation, site: Site, *, linke_turbidity: float | None = 3.0
) -> ClockOffset | None:
    """The offset with which clear days follow the sun, or None where no day tells it.

    A day's rows are fitted by a clear sky of two turbidities and a linear change through the day,
    at offsets of one minute; a sensor out of level and a hazy afternoon change the other three, not
    the offset. A day counts where the rows cover it and the fit is within `CLEAR_RESIDUAL`.
    """
    step = radiation.interval_min or radiation.step_min
    if not np.isfinite(step):
        return None
    total = radiation.table["global_w_m2"].to_numpy(float)
    start, end = radiation.intervals()
    late_ns = 60e9 * _late_min(0.5 * (start + end), total, site)
    day = np.floor((0.5 * (start + end) - late_ns) / 86400e9 + site.longitude_deg / 360.0)
    day = day.astype(int)
    best, weights, left = [], [], []
    for one in _brightest(day, total):
        rows = np.flatnonzero(day == one)
        noon_ns = (one + 0.5 - site.longitude_deg / 360.0) * 86400e9
        curves = _Curves(noon_ns, site, linke_turbidity)
        if not curves.is_covered(start[rows] - late_ns, end[rows] - late_ns, step):
            continue
        around = 0.0
        for reach, by in ((REACH_MIN, COARSE_MIN), (COARSE_MIN, FINE_MIN)):
            tried = around + np.arange(-reach, reach + by, by)
            residual = curves.residual(total[rows], start[rows], end[rows], tried)
            chosen = int(residual.argmin())
            around = tried[chosen]
        if np.sqrt(residual[chosen]) > CLEAR_RESIDUAL or chosen in (0, len(residual) - 1):
            continue
        best.append(_parabola(tried, residual, chosen))
        left.append(np.sqrt(residual[chosen]))
        now = curves.residual(total[rows], start[rows], end[rows], np.zeros(1))[0]
        lit = int((total[rows] > LIGHT_W_M2).sum())
        weights.append(lit * (now - residual[chosen]) / max(residual[chosen], 1e-7))
    if not best:
        return None
    minutes = float(np.median(best))
    apart = float(np.median(np.abs(np.array(best) - minutes)))
    if apart > max(3.0, step / 6.0):
        return None
    error_min = OFFSET_OF_RESIDUAL_MIN * float(np.median(left))
    return ClockOffset(minutes if np.sum(weights) > SURE else 0.0, len(best), error_min)


def _late_min(at_ns: np.ndarray, total: np.ndarray, site: Site) -> float:
    """How much later than noon light is centred through all days [min]; 0 where it is near.

    Where the sun does not set, a day is cut where the table itself is darkest: cut by a wrong
    clock it is made of two days.
    """
    turn = 2.0 * np.pi * (at_ns / 86400e9 + site.longitude_deg / 360.0 - 0.5)
    late = float(np.angle(np.sum(np.maximum(total, 0.0) * np.exp(1j * turn)))) / (2.0 * np.pi)
    return 1440.0 * late if abs(1440.0 * late) > CUT_ANEW_MIN else 0.0


def _brightest(day: np.ndarray, total: np.ndarray) -> np.ndarray:
    """The days with most light that have enough rows: clear days are among them."""
    sums = pd.DataFrame({"day": day, "total": total, "n": total > LIGHT_W_M2}).groupby("day").sum()
    bright = sums[sums["n"] >= 6].sort_values("total", ascending=False)
    return bright.index.to_numpy()[:MOST_DAYS]


def check(radiation: Radiation, site: Site, found: ClockOffset | None) -> Finding | None:
    """Name a label or a clock that the light contradicts, by the offset that was found."""
    step = radiation.interval_min or radiation.step_min
    if found is None:
        lopsided = _lopsided_days(radiation, site)
        return _light_at_night(radiation, site, lopsided) or lopsided
    if abs(found.minutes) < max(3.0, 0.35 * min(step, 15.0)) + found.error_min:
        return None
    off = abs(found.minutes)
    side = "earlier" if found.minutes < 0 else "later"
    days = f"{found.days} clear day" + ("s" if found.days > 1 else "")
    assumed = READ_AS[radiation.label]
    assumed += "" if radiation.is_declared else " (assumed: nothing is declared)"
    is_error = off >= 20.0 or not radiation.is_declared
    make = findings.error if is_error else findings.warning
    return make(
        radiation.where,
        f"light that follows the sun {off:.0f} min {side} than the stamps say, on {days}",
        f"light in step with the sun, read {assumed}",
        _remedy(radiation, found.minutes, step),
    )


def _remedy(radiation: Radiation, minutes: float, step_min: float) -> str:
    """What to declare so that times move by some minutes."""
    label, by_label = _label(minutes, radiation.label, step_min, radiation.is_declared)
    clock_min = minutes - by_label
    parts = []
    if label != radiation.label:
        parts.append(
            f"Stamps that mark the {label} of {step_min:g} min fit: set "
            f"`radiation.interval_label: {label}` and `radiation.interval_min: {step_min:g}`."
        )
    if abs(clock_min) > max(3.0, 0.15 * min(step_min, 30.0)):
        hour = round(clock_min / 60.0) * 60
        clock_min = hour if abs(clock_min - hour) <= max(8.0, 0.15 * step_min) else round(clock_min)
        parts.append(_zone_hint(radiation, int(clock_min)))
    return " ".join(parts)


def _label(minutes: float, label: str, step_min: float, is_declared: bool) -> tuple[str, float]:
    """The label that, with whole hours of the zone, explains an offset best, and its part [min]."""
    options = []
    for other, ahead in AHEAD.items():
        if other in ("instant", "middle") and label in ("instant", "middle"):
            other = label  # both mean the same time
        by_label = (ahead - AHEAD[label]) * step_min
        hours = round((minutes - by_label) / 60.0)
        rest = abs(minutes - by_label - 60.0 * hours)
        complexity = (3.0 if is_declared else 1.0) * (other != label) + 2.0 * (hours != 0)
        options.append((rest + complexity, other, by_label))
    _, chosen, by_label = min(options)
    return chosen, by_label


def _zone_hint(radiation: Radiation, minutes: int) -> str:
    """What to declare for a clock whose times have to be moved by some minutes."""
    state = f"{abs(minutes)} min {'ahead of' if minutes < 0 else 'behind'}"
    name = str(radiation.facts.get("timezone", "UTC"))
    try:
        zone = find_timezone(name)
    except InputError:
        return f"The clock is {state} the offsets in the file: correct them."
    there = radiation.table.index[0].to_pydatetime().astimezone(zone).utcoffset()
    kept = round((there.total_seconds() / 60.0 if there is not None else 0.0) - minutes)
    text = f"{'-' if kept < 0 else '+'}{abs(kept) // 60:02d}:{abs(kept) % 60:02d}"
    return (
        f"The clock is {state} '{name}': declare the offset that it kept, `radiation.timezone: "
        f"'{text}'`. A logger that stays on winter time needs an offset, not a name."
    )


def _light_at_night(radiation: Radiation, site: Site, lopsided: Finding | None) -> Finding | None:
    """Much light while the sun is down: the clock is off by hours, whatever the weather."""
    zenith = position(radiation.middles(), *site.place)["sun_zenith_deg"].to_numpy()
    margin = 3.0 + 0.125 * radiation.interval_min  # the sun climbs at most 15° an hour
    total = np.maximum(radiation.table["global_w_m2"].to_numpy(float), 0.0)
    dark = zenith > 90.0 + margin
    if not dark.any() or total[dark].max() < LIGHT_W_M2 or total[dark].sum() < 0.01 * total.sum():
        return None
    row = int(np.flatnonzero(dark)[total[dark].argmax()])
    return findings.error(
        radiation.where,
        f"{total[row]:.0f} W m⁻² at {radiation.table.index[row]}, with the sun "
        f"{zenith[row] - 90.0:.0f}° below the horizon",
        "light by day",
        "Check `radiation.timezone`, the date, and latitude and longitude of the site; remove rows "
        "that are faults of the sensor." + (f" {lopsided.remedy}" if lopsided else ""),
    )


def _lopsided_days(radiation: Radiation, site: Site) -> Finding | None:
    """Daylight that is not centred on solar noon, on many days of any weather."""
    total = radiation.table["global_w_m2"].to_numpy(float)
    at = radiation.middles().asi8
    apart = []
    day = np.floor(at / 86400e9 + site.longitude_deg / 360.0).astype(int)
    for one in np.unique(day):
        rows = np.flatnonzero(day == one)
        lit = np.flatnonzero(total[rows] > FIRST_LIGHT_W_M2)
        if len(lit) < 6 or lit[0] == 0 or lit[-1] == len(rows) - 1:
            continue
        edges = [
            np.interp(FIRST_LIGHT_W_M2, total[rows[pair]], at[rows[pair]])
            for pair in ([lit[0] - 1, lit[0]], [lit[-1] + 1, lit[-1]])
        ]
        apart.append((np.mean(edges) - _solar_noon_ns(one, site)) / 60e9)
    if len(apart) < 5:
        return None
    minutes, error = float(np.median(apart)), 1.25 * float(np.std(apart)) / np.sqrt(len(apart))
    if abs(minutes) < max(20.0, 4 * error):
        return None
    side = "later" if minutes > 0 else "earlier"
    return findings.warning(
        radiation.where,
        f"daylight that is centred {abs(minutes):.0f} min {side} than solar noon, on "
        f"{len(apart)} days",
        f"daylight around noon, read {READ_AS[radiation.label]}",
        "Check `radiation.interval_label` and `radiation.timezone`: "
        + _remedy(radiation, -minutes, radiation.interval_min or radiation.step_min)
        + " A horizon on one side has the same effect.",
    )


def _solar_noon_ns(day: int, site: Site) -> float:
    """When the sun is highest on a solar day, ns since 1970."""
    mean_noon = (day + 0.5 - site.longitude_deg / 360.0) * 86400e9
    date = pd.DatetimeIndex([pd.Timestamp(int(mean_noon), tz="UTC")])
    late_min = pvlib.solarposition.equation_of_time_pvcdrom(day_of_year(date))[0]
    return mean_noon - late_min * 60e9


@lru_cache(maxsize=256)
def _clear_sky(first_ns: int, count: int, site: Site, turbidity: float) -> np.ndarray:
    """Global radiation (count,) of a clear sky every `CURVE_STEP_MIN` [W m⁻²]."""
    moments = first_ns + (np.arange(count) * CURVE_STEP_MIN * 60e9).astype(np.int64)
    times = pd.DatetimeIndex(pd.to_datetime(moments, utc=True))
    return clear_sky(times, site, linke_turbidity=turbidity)["global_w_m2"].to_numpy()


class _Curves:
    """A clear day at two turbidities, averaged over any interval of it."""

    def __init__(self, noon_ns: float, site: Site, linke_turbidity: float | None):
        half = 12 * 60 + REACH_MIN + 120
        self.minutes = np.arange(-half, half + 1, CURVE_STEP_MIN)
        self.noon_ns = noon_ns
        hazy = 3.0 if linke_turbidity is None else linke_turbidity
        first_ns = int(noon_ns + self.minutes[0] * 60e9)
        self.curves = [
            _clear_sky(first_ns, len(self.minutes), site, turbidity)
            for turbidity in (max(hazy - 1.0, 1.5), hazy + 2.0)
        ]

    def residual(
        self, total: np.ndarray, start_ns: np.ndarray, end_ns: np.ndarray, tried_min: np.ndarray
    ) -> np.ndarray:
        """What clear skies leave of a day's rows at every tried offset: squares over squares."""
        first, last = ((edge - self.noon_ns) / 60e9 for edge in (start_ns, end_ns))
        shift = tried_min[:, None]
        means = [_means(self.minutes, one, first + shift, last + shift) for one in self.curves]
        through_day = (0.5 * (first + last) + shift) / 360.0
        base = np.stack([*means, means[0] * through_day], axis=-1)
        is_lit = (np.abs(base).max(axis=(1, 2)) > 0).nonzero()[0]
        left = np.ones(len(tried_min))
        direction = np.linalg.qr(base[is_lit])[0]
        explained = np.einsum("snk,n->sk", direction, total)
        rest = total - np.einsum("snk,sk->sn", direction, explained)
        left[is_lit] = (rest**2).sum(axis=1) / max(float((total**2).sum()), 1e-9)
        return left

    def is_covered(self, start_ns: np.ndarray, end_ns: np.ndarray, step_min: float) -> bool:
        """Whether the rows span the day and leave no more than a tenth of it out."""
        up = self.minutes[(self.curves[0] > LIGHT_W_M2) & (np.abs(self.minutes) < 12 * 60)]
        if not len(up):
            return False
        middle = (0.5 * (start_ns + end_ns) - self.noon_ns) / 60e9
        inside = (middle >= up[0] - step_min) & (middle <= up[-1] + step_min)
        is_dense = inside.sum() * step_min > 0.9 * (up[-1] - up[0])
        return bool(is_dense and np.diff(middle).max() <= 3 * step_min)


def _means(at: np.ndarray, values: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Means over intervals of a series, linear between its moments; its values where they are 0."""
    if (last - first).max() < 1e-6:
        return np.interp(first, at, values)
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(at)
    sums = np.concatenate([[0.0], np.cumsum(steps)])
    return (np.interp(last, at, sums) - np.interp(first, at, sums)) / (last - first)


def _parabola(tried_min: np.ndarray, residual: np.ndarray, chosen: int) -> float:
    """The offset of the least residual, between the tried ones [min]."""
    left, middle, right = residual[chosen - 1 : chosen + 2]
    curvature = left - 2 * middle + right
    between = 0.5 * (left - right) / curvature if curvature > 0 else 0.0
    return float(tried_min[chosen] + between * (tried_min[1] - tried_min[0]))
