"""Can records be right? Their unit and their clock, against simulated light of the same sensors."""

import numpy as np
import pandas as pd

from dapple import findings
from dapple.findings import Finding
from dapple.formats import units

OTHER_UNITS = {
    "mmol/m2/s": 1e-3,
    "W/m2": 1 / units.SUNLIGHT_UMOL_PER_J,
    "klx": 1e-3 * units.DAYLIGHT_LX_PER_UMOL,
    "lx": units.DAYLIGHT_LX_PER_UMOL,
    "W/m2 of global radiation": 1 / 2.06,
}
"""What 1 µmol m⁻² s⁻¹ of sunlit PAR is in units in which it is written now and then."""
USUAL_RATIO = (0.5, 1.6)
"""Brightest records over the brightest simulated light: beyond, something is wrong."""
LIT_UMOL_M2_S = 100.0
LONGEST_LAG_MIN = 150
LAG_STEP_MIN = 5
CLEARLY_BETTER = 0.02
"""By so much r has to rise before another clock is named."""


def check(pairs: pd.DataFrame, records: pd.DataFrame) -> list[Finding]:
    """What speaks against the unit and the clock of records.

    Parameters
    ----------
    pairs : pandas.DataFrame
        As `pairs.pair` makes it, of one or several reconstructions; the first one is used.
    records : pandas.DataFrame
        All records: `sensor`, `time`, `par_umol_m2_s`, perhaps `interval_s`.

    Returns
    -------
    list of Finding
        Warnings: simulated light is no measurement.
    """
    one = pairs[pairs["reconstruction"] == pairs["reconstruction"].iloc[0]]
    return [found for found in (_unit(one), _clock(one, records)) if found is not None]


def _unit(pairs: pd.DataFrame) -> Finding | None:
    """Brightest records beside the brightest simulated light."""
    lit = pairs[pairs["baseline"] > LIT_UMOL_M2_S]
    if len(lit) < 20:
        return None
    measured, simulated = (
        float((lit[name] / lit["baseline"]).quantile(0.98)) for name in ("measured", "simulated")
    )
    if simulated < 0.2 or USUAL_RATIO[0] <= measured / simulated <= USUAL_RATIO[1]:
        return None
    ratio = max(measured / simulated, 1e-9)
    fitting = {unit: abs(np.log(ratio / factor)) for unit, factor in OTHER_UNITS.items()}
    unit = min(fitting, key=fitting.__getitem__)
    hint = f"This fits {unit}. " if fitting[unit] < 0.35 else ""
    return findings.warning(
        "measured PAR",
        f"the brightest records {ratio:.3g} times as bright as the brightest simulated light",
        "about as bright, in µmol m⁻² s⁻¹",
        f"{hint}Check `measured.unit`, calibration and radiation.",
    )


def _clock(pairs: pd.DataFrame, records: pd.DataFrame) -> Finding | None:
    """A shift of the records in time that fits simulated light clearly better."""
    lags = np.arange(-LONGEST_LAG_MIN, LONGEST_LAG_MIN + 1, LAG_STEP_MIN)
    moved, light = [], []
    series = dict(list(records.dropna(subset="par_umol_m2_s").groupby("sensor", sort=False)))
    for sensor, rows in pairs.groupby("sensor", sort=False):
        own = series[sensor]
        stamps = _minutes(own["time"])
        if len(stamps) < 3:
            continue
        at = _minutes(rows["time"])[None, :] + lags[:, None]
        values = np.interp(at, stamps, own["par_umol_m2_s"].to_numpy())
        moved.append(np.where((at >= stamps[0]) & (at <= stamps[-1]), values, np.nan))
        light.append(rows["simulated"].to_numpy())
    if not light or sum(map(len, light)) < 20:
        return None
    values, simulated = np.concatenate(moved, axis=1), np.concatenate(light)
    enough = np.isfinite(values).mean(axis=1) > 0.7
    fits = np.array(
        [_r(row, simulated) if ok else -1.0 for row, ok in zip(values, enough, strict=True)]
    )
    best, now = int(np.nanargmax(fits)), fits[len(lags) // 2]
    length = float(records["interval_s"].median()) / 60.0 if "interval_s" in records else 0.0
    lag = int(lags[best])
    if abs(lag) < max(LAG_STEP_MIN, 0.35 * length) or not fits[best] > now + CLEARLY_BETTER:
        return None
    side = "later" if lag > 0 else "earlier"
    return findings.warning(
        "measured PAR",
        f"records that fit simulated light of {abs(lag)} min {'earlier' if lag > 0 else 'later'} "
        f"best (r {fits[best]:.3f} instead of {now:.3f})",
        "records in step with the sun",
        f"Their stamps look {abs(lag)} min {side} than the light: check `measured.interval_label` "
        "(a stamp at the end of an hour is 30 min after its middle), `measured.timezone` and the "
        "loggers' clock.",
    )


def _r(values: np.ndarray, simulated: np.ndarray) -> float:
    known = np.isfinite(values)
    if known.sum() < 20 or np.std(values[known]) == 0 or np.std(simulated[known]) == 0:
        return -1.0
    return float(np.corrcoef(values[known], simulated[known])[0, 1])


def _minutes(times: pd.Series) -> np.ndarray:
    return times.astype("datetime64[ns, UTC]").astype(np.int64).to_numpy() / 60e9
