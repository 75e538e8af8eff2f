"""The sentences that matter first of studies that have no verdict, told from their tables."""

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from dapple.formats import tables
from dapple.report.blocks import number
from dapple.report.recommendation import called


def sentences(folder: Path) -> list[str]:
    """What a study found, from its tables; nothing where there are none."""
    found: list[str] = []
    for name, says in LEADS.items():
        if (path := folder / name).is_file():
            found += says(tables.read(path))
    return found


def _survey(table: pd.DataFrame) -> Iterator[str]:
    """From which design least stays unseen, with the finest scans that were tried."""
    finest = table[table["n_beams"] == table["n_beams"].max()]
    shadow = finest.groupby("design")["rs"].mean().sort_values()
    best, worst = shadow.index[0], shadow.index[-1]
    yield (
        f"With the finest scans, {_per_cent(shadow.iloc[0])} of the filled voxels stay unseen from "
        f"the positions of {best}"
        + (
            f", the best of the designs, and {_per_cent(shadow.iloc[-1])} from those of {worst}."
            if best != worst
            else "."
        )
    )


def _stability(table: pd.DataFrame) -> Iterator[str]:
    """Which reconstruction withstands most troubles, and which the fewest."""
    n = table["stressor"].nunique()
    failed = table.dropna(subset="level").groupby("reconstruction")["stressor"].nunique()
    failed = failed.reindex(table["reconstruction"].unique(), fill_value=0).sort_values()
    counts = ", ".join(f"{count} for {called(str(name))}" for name, count in failed.items())
    yield (
        f"Of {n} kinds of trouble that a scan can have, each made worse step by step, so many cost "
        f"a reconstruction a fifth of its r or doubled its error: {counts}."
    )


def _chlorophyll(table: pd.DataFrame) -> Iterator[str]:
    """How far retrieved chlorophyll is from measured trees, else from simulated entries."""
    own = table[table["seed"].astype(str) == "ensemble"].dropna(subset="rmse")
    trees = own[own["test_set"] == "field"]
    what = "trees" if len(trees) else "simulated entries that were kept aside"
    for plot, rows in (trees if len(trees) else own).groupby("plot"):
        best = rows.loc[rows["rmse"].idxmin()]
        yield (
            f"{plot}: nearest to {best['n']:.0f} {what} comes {called(str(best['model']))} with an "
            f"RMSE of {number(best['rmse'])} µg cm⁻²; over all models and networks the RMSE is "
            f"{number(rows['rmse'].min())} to {number(rows['rmse'].max())} µg cm⁻²."
        )
    if not len(trees):
        yield "No measured tree tells how far the map is from what grows there."


def _per_cent(share: float) -> str:
    return f"{100 * share:.0f} %"


LEADS = {
    "survey/shadowing.csv": _survey,
    "stability/thresholds.csv": _stability,
    "chlorophyll/accuracy.csv": _chlorophyll,
}
"""What says it, by the table that it is said from."""
