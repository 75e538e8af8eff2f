"""Which signals go with losses: learned from stress runs, tried on others."""

import math
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import minimize

from dapple.verdict.departure import departure, expected_loss, transformed
from dapple.verdict.signal_meanings import OF_RECORDS, SIGNALS

R_LOST, RMSE_GROWN = 0.2, 1.0
"""Losses of 1: this share of the undisturbed run's r lost, or RMSE grown by this multiple of it."""
WORST = 2.0
"""Losses are learned up to this: what is far beyond failure need not be told apart."""
TRACELESS = ("sensor_position", "clock_offset")
"""Stressors that leave no trace in scans: only records of light can show them."""
MIN_RUNS = 10
"""Fewest sound runs from which a reconstruction's model is made."""


def losses(points: pd.DataFrame) -> pd.Series:
    """What runs lost, compared with the undisturbed run of stressor, reconstruction and seed.

    Parameters
    ----------
    points : DataFrame
        `stressor`, `level`, `reconstruction`, `seed`, `r`, `rmse_rel`, `harmless` (bool), `failed`
        (text, empty where it was made).

    Returns
    -------
    Series of float
        The larger of the share of r lost over 0.2 and the growth of relative RMSE over 1, so that
        1 and more is a failure; infinite where it could not be made. r that is unknown because
        light was constant does not count.
    """
    key = ["stressor", "reconstruction", "seed"]
    base = points[points["harmless"].astype(bool)].set_index(key)[["r", "rmse_rel"]]
    base = base[~base.index.duplicated()]
    own = base.reindex(pd.MultiIndex.from_frame(points[key]))
    lost, grown = (
        1 - points["r"].to_numpy(float) / own["r"].to_numpy(float),
        points["rmse_rel"].to_numpy(float) / own["rmse_rel"].to_numpy(float) - 1,
    )
    loss = np.nan_to_num(np.fmax(lost / R_LOST, grown / RMSE_GROWN), nan=0.0)
    return pd.Series(np.where(has_run(points), loss, np.inf), points.index, name="loss")


def has_run(points: pd.DataFrame) -> np.ndarray:
    """(n,) bool, False where a reconstruction stopped with a message."""
    if "failed" not in points:
        return np.ones(len(points), bool)
    return (points["failed"].fillna("").astype(str) == "").to_numpy()


def _marked(points: pd.DataFrame) -> pd.DataFrame:
    loss = losses(points)
    return points.assign(loss=loss, is_failure=loss > 1, ran=has_run(points))


def prepared(points: pd.DataFrame) -> pd.DataFrame:
    """Runs with `loss`, `is_failure` and `ran`; undisturbed runs that stressors share only once."""
    marked = _marked(points)
    harmless = marked["harmless"].astype(bool)
    # Levels with other conditions than the undisturbed run's have other results and stay.
    again = marked.duplicated(["reconstruction", "seed", "r", "rmse_rel"]) & harmless
    return marked[~again].reset_index(drop=True)


def first_half(runs: pd.DataFrame, seed: int = 0) -> np.ndarray:
    """(n,) bool: half of the runs, by chance; all reconstructions of a run are on the same side."""
    level = runs["level"].map(lambda value: f"{float(value):g}")
    keys = runs["stressor"].astype(str) + "|" + level + "|" + runs["seed"].astype(str)
    unique = np.unique(keys)
    chosen = np.random.default_rng(seed).permutation(len(unique)) < len(unique) / 2
    return keys.isin(unique[chosen]).to_numpy()


def fit(
    points: pd.DataFrame,
    *,
    undisturbed: pd.DataFrame | None = None,
    with_records: bool = False,
    penalty: float = 10.0,
    most_false_alarms: float = 0.12,
    least_loss: float = 0.15,
) -> dict[str, dict]:
    """Learn which signals go with losses, for each reconstruction by itself.

    Parameters
    ----------
    points : DataFrame
        Stress runs with signals, as `losses` takes them (or as `prepared` gives them).
    undisturbed : DataFrame, optional
        Runs that tell what is usual; else the harmless ones among the points.
    with_records : bool
        Use signals that need measured light, too.
    penalty : float
        Weight of the sum of squared weights against that of squared residuals.
    most_false_alarms : float
        Share of sound runs above the threshold of alarm, each judged by models fitted to others;
        a fifth of it is above that of red. Less than the 15 % that are bearable, as runs unlike
        these raise more.
    least_loss : float
        No smaller expected loss raises an alarm, however rare it is.

    Returns
    -------
    dict of str to dict
        By reconstruction: `signals` (by name: `usual`, the median of undisturbed runs, `scale`,
        `weight`, and the range from `low` to `high` that was seen), `intercept`, `amber` and `red`
        (expected losses), numbers of `runs` and `failures`.
    """
    runs = points if "is_failure" in points else prepared(points)
    if undisturbed is None:
        undisturbed = runs[runs["harmless"].astype(bool)]
    names = [name for name in SIGNALS if name in runs and (with_records or name not in OF_RECORDS)]
    models = {}
    for name, rows in runs[runs["ran"]].groupby("reconstruction"):
        if (~rows["is_failure"]).sum() >= MIN_RUNS:
            own = [signal for signal in names if SIGNALS[signal].only_of in ("", name)]
            models[str(name)] = _fit_one(
                rows, undisturbed, own, penalty, most_false_alarms, least_loss
            )
    return models


def _fit_one(
    rows: pd.DataFrame,
    undisturbed: pd.DataFrame,
    names: list[str],
    penalty: float,
    most: float,
    least: float,
) -> dict:
    learned = {}
    for name in names:
        values = transformed(name, rows[name])
        known = np.isfinite(values)
        usual = transformed(name, undisturbed[name])
        usual = usual[np.isfinite(usual)]
        if known.mean() < 0.3 or not len(usual) or values[known].std() < 1e-9:
            continue
        learned[name] = {
            "usual": float(np.median(usual)),
            "scale": float(values[known].std()),
            "low": float(values[known].min()),
            "high": float(values[known].max()),
        }
    x = np.stack([departure(name, rows[name], learned[name]) for name in learned], axis=1)
    loss = np.clip(rows["loss"].to_numpy(float), 0.0, WORST)
    weight, intercept = _regression(x, loss, penalty)
    for name, value in zip(learned, weight.tolist(), strict=True):
        learned[name]["weight"] = round(value, 4)
    failed = rows["is_failure"].to_numpy(bool)
    sound = _out_of_fold(x, loss, penalty)[~failed]
    amber, red = (max(float(np.quantile(sound, 1 - p)), least) for p in (most, 0.2 * most))
    return {
        "signals": {name: facts for name, facts in learned.items() if facts["weight"] > 0},
        "intercept": intercept,
        "amber": amber,
        "red": red,
        "runs": len(rows),
        "failures": int(failed.sum()),
    }


def _out_of_fold(x: np.ndarray, loss: np.ndarray, penalty: float, folds: int = 5) -> np.ndarray:
    """Loss that models fitted to other runs make expect of each, for an honest threshold."""
    fold = np.random.default_rng(0).permutation(len(loss)) % folds
    found = np.empty(len(loss))
    for k in range(folds):
        own = fold == k
        weight, intercept = _regression(x[~own], loss[~own], penalty)
        found[own] = x[own] @ weight + intercept
    return found


def _regression(x: np.ndarray, y: np.ndarray, penalty: float) -> tuple[np.ndarray, float]:
    """Weights (none negative) and intercept of a ridge regression."""

    def squares(w: np.ndarray) -> tuple[float, np.ndarray]:
        away = x @ w[1:] + w[0] - y
        value = 0.5 * (away**2).sum() + 0.5 * penalty * (w[1:] ** 2).sum()
        return value, np.concatenate([[away.sum()], x.T @ away + penalty * w[1:]])

    bounds = [(None, None), *[(0, None)] * x.shape[1]]
    start = np.concatenate([[y.mean()], np.zeros(x.shape[1])])
    found = minimize(squares, start, jac=True, bounds=bounds, method="L-BFGS-B")
    return found.x[1:], float(found.x[0])


def flagged(runs: pd.DataFrame, models: dict[str, dict]) -> np.ndarray:
    """(n,) bool: runs whose verdict is amber or red; what could not be made says so itself."""
    amber = runs["reconstruction"].map({name: model["amber"] for name, model in models.items()})
    return (expected_loss(runs, models) >= amber.to_numpy(float)) | ~has_run(runs)


def cross_flagged(points: pd.DataFrame, *, seed: int = 0, **settings: Any) -> np.ndarray:
    """(n,) bool: each half of the runs judged by models that were fitted to the other half.

    Parameters
    ----------
    points, settings
        As in `fit`.
    seed : int
        Draws the halves.
    """
    marked = points if "is_failure" in points else _marked(points)
    first = first_half(marked, seed)
    settings = {"undisturbed": marked[marked["harmless"].astype(bool)]} | settings
    alarm = np.zeros(len(marked), bool)
    for half in (first, ~first):
        alarm[half] = flagged(marked[half], fit(marked[~half], **settings))
    return alarm


def rates(runs: pd.DataFrame, alarm: np.ndarray) -> dict[str, float]:
    """Share of failures that were flagged, and of sound runs that were flagged as well.

    Parameters
    ----------
    runs : DataFrame
        As `prepared` gives them.
    alarm : (n,) bool

    Returns
    -------
    dict
        `runs`, `failures`, `detection`, `false_alarms`; `precision`, the share of flagged runs that
        failed; `failed_levels`, how many levels of stressors failed, whatever the world and
        reconstruction: runs of one level fail together and are no independent evidence.
        `detection_traced` is among the `failures_traced`: those that ran, stressors without a trace
        in the scan (`TRACELESS`) left out.
    """
    failed = runs["is_failure"].to_numpy(bool)
    traced = failed & runs["ran"].to_numpy(bool) & ~runs["stressor"].isin(TRACELESS).to_numpy()

    def share(of: np.ndarray) -> float:
        return float(alarm[of].mean()) if of.any() else math.nan

    return {
        "runs": len(runs),
        "failures": int(failed.sum()),
        "detection": share(failed),
        "false_alarms": share(~failed),
        "precision": float(failed[alarm].mean()) if alarm.any() else math.nan,
        "failed_levels": len(runs.loc[failed, ["stressor", "level"]].drop_duplicates()),
        "failures_traced": int(traced.sum()),
        "detection_traced": share(traced),
    }


def validate(
    points: pd.DataFrame, *, seed: int = 0, with_records: bool = False, **settings: Any
) -> dict[str, dict]:
    """Fit on a half, judge the other, both ways; leave out each stressor, and each world.

    Parameters
    ----------
    points, with_records
        As in `fit`.
    seed : int
        Draws the halves.
    settings
        Of `fit`.

    Returns
    -------
    dict
        `halves`, `unseen_stressor` and `unseen_world`, each as `rates` gives them: what is left out
        is judged by models that never saw trouble of its kind, or another tree and scan.
        `by_reconstruction` and `by_stressor` part the halves.
    """
    runs = prepared(points)
    settings |= {"with_records": with_records}
    everywhere = {"undisturbed": runs[runs["harmless"].astype(bool)]} | settings
    halves = cross_flagged(runs, seed=seed, **everywhere)
    found: dict[str, Any] = {
        "halves": rates(runs, halves),
        "unseen_stressor": rates(runs, unseen_flagged(runs, "stressor", **everywhere)),
        # What is usual is told by the other worlds, too: a user's tree is not among them.
        "unseen_world": rates(runs, unseen_flagged(runs, "seed", **settings)),
    }
    for column in ("reconstruction", "stressor"):
        found[f"by_{column}"] = {
            str(key): rates(rows, halves[rows.index]) for key, rows in runs.groupby(column)
        }
    return found


def unseen_flagged(runs: pd.DataFrame, column: str, **settings: Any) -> np.ndarray:
    """(n,) bool: runs of each value of a column, judged by models fitted to all other runs."""
    runs = runs if "is_failure" in runs else _marked(runs)
    alarm = np.zeros(len(runs), bool)
    for value in runs[column].unique():
        own = (runs[column] == value).to_numpy()
        alarm[own] = flagged(runs[own], fit(runs[~own], **settings))
    return alarm
