"""From which level on a reconstruction has failed, and where the published findings hold."""

import numpy as np
import pandas as pd

R_LOST = 0.05
"""Loss of r against the harmless level at which a reconstruction counts as failed."""
RMSE_FACTOR = 2.0
"""Growth of the root mean square error at which it does too."""
KEYS = ["stressor", "reconstruction"]


def against_harmless(points: pd.DataFrame) -> pd.DataFrame:
    """Add what each run of a reconstruction would have been without the stressor.

    Parameters
    ----------
    points : DataFrame
        Runs, with `stressor`, `reconstruction`, `seed`, `harmless`, `r`, `rmse_rel`.

    Returns
    -------
    DataFrame
        With `r_harmless` and `rmse_harmless`: the same reconstruction, world and stressor at the
        harmless level.
    """
    names = [*KEYS, "seed"]
    harmless = points[points["harmless"].astype(bool)].groupby(names)[["r", "rmse_rel"]].first()
    harmless = harmless.rename(columns={"r": "r_harmless", "rmse_rel": "rmse_harmless"})
    kept = points.drop(columns=harmless.columns, errors="ignore")
    return kept.merge(harmless, how="left", left_on=names, right_index=True)


def has_failed(
    points: pd.DataFrame, *, r_lost: float = R_LOST, rmse_factor: float = RMSE_FACTOR
) -> np.ndarray:
    """Runs (n,) that lost `r_lost` of r, multiplied their error, or never came through.

    Parameters
    ----------
    points : DataFrame
        As `against_harmless` gives it.
    r_lost, rmse_factor : float
        Loss of r and growth of `rmse_rel` from which on a run has failed.
    """
    worse = points["r_harmless"] - points["r"] >= r_lost
    wilder = points["rmse_rel"] >= rmse_factor * points["rmse_harmless"]
    return (worse | wilder | points["rmse_rel"].isna()).to_numpy()


def table(points: pd.DataFrame) -> pd.DataFrame:
    """The level at which each reconstruction has failed.

    Parameters
    ----------
    points : DataFrame
        All runs.

    Returns
    -------
    DataFrame
        One row a stressor and reconstruction: `r_harmless`, `rmse_harmless`, `r_worst`,
        `rmse_worst` (medians over seeds, at the level with the lowest r), `level` and `label` of
        the level nearest to the harmless one at which most seeds have failed, on either side of
        it, empty where none has; `reason`: `r`, `rmse` or `no result`.
    """
    points = against_harmless(points)
    points = points.assign(has_failed=has_failed(points))
    rows = []
    for (stressor, reconstruction), runs in points.groupby(KEYS, sort=False):
        levels = runs.groupby("level").agg(
            label=("label", "first"),
            harmless=("harmless", "first"),
            r=("r", "median"),
            rmse=("rmse_rel", "median"),
            share=("has_failed", "mean"),
            r_harmless=("r_harmless", "median"),
            rmse_harmless=("rmse_harmless", "median"),
        )
        worst = levels.iloc[int(np.argmin(levels["r"].fillna(-1)))]
        row = {
            "stressor": stressor,
            "reconstruction": reconstruction,
            "r_harmless": levels["r_harmless"].iloc[0],
            "rmse_harmless": levels["rmse_harmless"].iloc[0],
            "r_worst": worst["r"],
            "rmse_worst": worst["rmse"],
        }
        found = _nearest_failure(levels)
        rows.append(
            row | ({"level": np.nan, "label": "", "reason": ""} if found is None else found)
        )
    return pd.DataFrame(rows)


def _nearest_failure(levels: pd.DataFrame) -> dict | None:
    """The failed level nearest to the harmless one, by the order of levels."""
    harmless = int(np.argmax(levels["harmless"].astype(bool)))
    failed = np.flatnonzero((levels["share"] > 0.5).to_numpy())
    if not len(failed):
        return None
    at = levels.iloc[failed[np.argmin(np.abs(failed - harmless))]]
    reason = "r" if at["r_harmless"] - at["r"] >= R_LOST else "rmse"
    if np.isnan(at["rmse"]):
        reason = "no result"
    return {"level": at.name, "label": at["label"], "reason": reason}


def published(points: pd.DataFrame) -> pd.DataFrame:
    """Where the findings of Frey et al. (2025) hold, by stressor and level.

    Returns
    -------
    DataFrame
        Medians over seeds of r, mean PAR (a share of open-sky PAR) and leaf area of polygons
        and voxels, and for each finding the share of seeds in which it holds:
        `order_of_r` (polygons above 0.2 m voxels above 1 m voxels), `polygons_brighter` (more
        PAR than under 0.2 m voxels), `polygons_larger` (more leaf area).
    """
    names = ("polygons", "voxels_0.2", "voxels_1.0")
    runs = points[points["reconstruction"].isin(names)]
    wide = runs.pivot_table(
        index=["stressor", "level", "label", "seed"],
        columns="reconstruction",
        values=["r", "mean_par_rel", "leaf_area_m2"],
        sort=False,
    ).dropna()
    if wide.empty:
        return pd.DataFrame()
    r, par, area = (wide[name] for name in ("r", "mean_par_rel", "leaf_area_m2"))
    facts = pd.DataFrame(
        {
            "order_of_r": (r["polygons"] > r["voxels_0.2"]) & (r["voxels_0.2"] > r["voxels_1.0"]),
            "polygons_brighter": par["polygons"] > par["voxels_0.2"],
            "polygons_larger": area["polygons"] > area["voxels_0.2"],
        }
    ).astype(float)
    for quantity in ("r", "mean_par_rel", "leaf_area_m2"):
        for name in names:
            facts[f"{quantity}_{name}"] = wide[quantity][name]
    keys = ["stressor", "level", "label"]
    held = facts.groupby(keys, sort=False)[list(facts.columns[:3])].mean()
    middle = facts.groupby(keys, sort=False)[list(facts.columns[3:])].median()
    return held.join(middle).reset_index()
