"""What wrong clocks, wrong places and fewer records do to the agreement with real records."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.stability.outcome import agreement
from dapple.stability.stressors import Level, Stressor, find
from dapple.streams import stream_seed

MAX_STEP_MIN = 5.0
"""Light is drawn between its times where clocks are wrong; they may lie this far apart [min]."""


def _shares(name: str, title: str, values: tuple[float, ...]) -> Stressor:
    return Stressor(name, title, tuple(Level(v, f"{v:g}", {}) for v in values), 1.0)


KEYS = ["reconstruction", "sensor"]

STRESSORS = (
    find("clock_offset"),
    find("sensor_position"),
    _shares("few_records", "share of records kept", (0.003, 0.01, 0.03, 0.1, 1.0)),
    _shares("few_sensors", "share of sensors kept", (0.1, 0.2, 0.35, 0.5, 1.0)),
)
"""What can be made worse about records; the first two are those of the virtual worlds."""


def clocks_off(
    records: pd.DataFrame, light: pd.DataFrame, offset_min: float, seed: int
) -> pd.DataFrame:
    """Compare records with the light of another minute.

    Parameters
    ----------
    records : DataFrame
        `reconstruction, sensor, time, simulated`; the logger is what stands before `_` in the
        sensor's label.
    light : DataFrame
        `reconstruction, sensor, time, simulated` at all times, measured or not, by time.
    offset_min : float
        How far the clock of each logger is ahead or behind [min].
    seed : int
        Chooses which of the two, for each logger.

    Returns
    -------
    DataFrame
        The records with other light, those left out for whose time there is none.

    Raises
    ------
    InputError
        Times so far apart that light between them is not known.
    """
    if not offset_min:
        return records
    logger = records["sensor"].str.partition("_")[0]
    names = np.unique(logger)
    sign = dict(zip(names, np.random.default_rng(seed).choice([-1, 1], len(names)), strict=True))
    start = light["time"].min()
    known = {key: (_minutes(own, start), own) for key, own in light.groupby(KEYS)}
    parts = []
    for key, series in records.groupby(KEYS, sort=False):
        minute, own = known[key]
        _check_step(minute)
        then = _minutes(series, start) + sign[logger[series.index[0]]] * offset_min
        within = (then >= minute[0]) & (then <= minute[-1])
        values = np.interp(then[within], minute, own["simulated"])
        parts.append(series[within].assign(simulated=values))
    return pd.concat(parts, ignore_index=True)


def _minutes(series: pd.DataFrame, start: pd.Timestamp) -> np.ndarray:
    return (series["time"] - start).dt.total_seconds().to_numpy() / 60


def _check_step(minute: np.ndarray) -> None:
    step = np.diff(minute).max() if len(minute) > 1 else np.inf
    if step > MAX_STEP_MIN:
        raise InputError(
            "time.step_min",
            f"light every {step:g} min" if len(minute) > 1 else "light at a single time",
            f"steps of {MAX_STEP_MIN:g} min at most, to compare wrong clocks",
            "Set time.step_min to 1.",
        )


def fewer(records: pd.DataFrame, keys: list[str], share: float, seed: int) -> pd.DataFrame:
    """Keep a share of the records, or of what `keys` tell apart; at least two.

    What is kept of a smaller share is among what is kept of a larger one, and the same for every
    reconstruction.
    """
    own = pd.MultiIndex.from_frame(records[keys])
    unique = own.unique()
    n = max(2, round(share * len(unique)))
    return records[own.isin(unique[np.random.default_rng(seed).permutation(len(unique))[:n]])]


def table(
    records: pd.DataFrame,
    light: pd.DataFrame,
    moved: Callable[[float, int], pd.DataFrame],
    *,
    n_levels: int,
    n_seeds: int,
    seed: int,
) -> pd.DataFrame:
    """Agreement of every reconstruction with the records at all levels of all stressors.

    Parameters
    ----------
    records : DataFrame
        `reconstruction, sensor, time, measured, simulated, baseline` [µmol m⁻² s⁻¹], of sensors
        and times that no fit has seen.
    light : DataFrame
        As `clocks_off` takes it.
    moved : callable
        The records with the light at sensors that are wrong by a distance [m], given a seed.
    n_levels, n_seeds : int
        Most levels of a stressor; draws of each.
    seed : int

    Returns
    -------
    DataFrame
        `stressor, level, label, reconstruction, seed, n_sensors, n`, and `r`, `rmse_rel`,
        `bias_rel`, errors as shares of open-sky PAR.
    """
    change = {
        "clock_offset": lambda level, own: clocks_off(records, light, level, own),
        "sensor_position": moved,
        "few_records": lambda level, own: fewer(records, ["sensor", "time"], level, own),
        "few_sensors": lambda level, own: fewer(records, ["sensor"], level, own),
    }
    rows = []
    for stressor in STRESSORS:
        for level in stressor.chosen(n_levels):
            for number in range(1, n_seeds + 1):
                worse = change[stressor.name](level.value, stream_seed(seed, number))
                head = {"stressor": stressor.name, "level": level.value, "label": level.label}
                rows += [
                    head | {"reconstruction": name, "seed": number} | compared(group)
                    for name, group in worse.groupby("reconstruction", sort=False)
                ]
    return pd.DataFrame(rows)


def compared(records: pd.DataFrame) -> dict[str, float]:
    """Number of sensors and records of one reconstruction, and how well its light agrees."""
    simulated, measured, open_sky = (
        records[name].to_numpy(np.float64) for name in ("simulated", "measured", "baseline")
    )
    found = agreement(simulated[None], measured[None], open_sky)
    return {"n_sensors": records["sensor"].nunique(), "n": len(records)} | {
        name: found[name] for name in ("r", "rmse_rel", "bias_rel")
    }
