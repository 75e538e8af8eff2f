"""Box plots of per-sensor r by reconstruction."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dapple.figures import style
from dapple.formats import tables


def of_run(inputs: Mapping[str, Any], options: Mapping[str, Any]) -> Figure:
    """From the files of a run: `per_sensor`, `overall`."""
    return draw(tables.read(inputs["per_sensor"]), tables.read(inputs["overall"]))


@style.styled
def draw(per_sensor: pd.DataFrame, overall: pd.DataFrame | None = None) -> Figure:
    """Boxes with a point per sensor, as in Frey et al. (2025), figure 5.

    Parameters
    ----------
    per_sensor : DataFrame
        `reconstruction, sensor, r`; sensors without r are left out and counted.
    overall : DataFrame, optional
        `reconstruction, r, r_low, r_high, baseline_r`: draws r over all records as a diamond with
        its interval, and the baseline without a tree as a dashed line.
    """
    names = tuple(per_sensor["reconstruction"].unique())
    figure = style.new_figure(1.6 + 1.15 * len(names), 3.8)
    axes = figure.subplots()
    for place, name in enumerate(names):
        r = per_sensor.loc[per_sensor["reconstruction"] == name, "r"]
        _box(axes, place, r.dropna().to_numpy(), style.colour(name, names))
        if overall is not None:
            _overall(axes, place, overall[overall["reconstruction"] == name])
    if overall is not None:
        _baseline(axes, overall["baseline_r"].dropna())
    counts = per_sensor.groupby("reconstruction")["r"].count()
    axes.set_xticks(range(len(names)), [f"{style.label(n)}\n(n = {counts[n]})" for n in names])
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="x", visible=False)
    axes.set_xlim(-0.6, len(names) - 0.4)
    lowest = min(per_sensor["r"].min(), 0.0 if overall is None else overall["baseline_r"].min())
    axes.set_ylim(min(0.0, np.nan_to_num(lowest) - 0.05), 1.02)
    axes.set_ylabel("Pearson's r between measured and simulated PAR")
    return figure


def _box(axes: Axes, place: float, r: np.ndarray, colour: str) -> None:
    if not len(r):
        return
    axes.boxplot(
        [r],
        positions=[place],
        widths=0.5,
        capwidths=0.18,
        showfliers=False,
        patch_artist=True,
        boxprops={"facecolor": colour, "alpha": 0.25, "edgecolor": "none"},
        medianprops={"color": colour, "linewidth": 2.2, "solid_capstyle": "butt"},
        whiskerprops={"color": colour, "linewidth": 1.0},
        capprops={"color": colour, "linewidth": 1.0},
    )
    axes.scatter(
        place + _spread(r), r, s=13, color=colour, alpha=0.85, linewidths=0.4, edgecolors="white",
        zorder=3,
    )  # fmt: skip


def _spread(r: np.ndarray, half_width: float = 0.19) -> np.ndarray:
    """Sideways offsets by rank (golden ratio): no two neighbours in r overlap, no chance."""
    rank = np.argsort(np.argsort(r, kind="stable"), kind="stable")
    return half_width * (2 * ((rank * 0.6180339887) % 1.0) - 1)


def _overall(axes: Axes, place: float, row: pd.DataFrame) -> None:
    if row.empty or not np.isfinite(row["r"].iloc[0]):
        return
    r, low, high = (float(row[name].iloc[0]) for name in ("r", "r_low", "r_high"))
    x = place + 0.37
    if np.isfinite(low) and np.isfinite(high):
        axes.plot([x, x], [low, high], color="#222222", linewidth=1.2, zorder=3)
    label = "all records, with interval" if place == 0 else None
    axes.scatter([x], [r], marker="D", s=22, color="#222222", zorder=4, label=label)


def _baseline(axes: Axes, baseline_r: pd.Series) -> None:
    if len(baseline_r):
        style_line = {
            "color": style.COLOURS["baseline"],
            "linestyle": (0, (4, 3)),
            "linewidth": 1.1,
        }
        axes.axhline(baseline_r.iloc[0], label="sky without a tree", zorder=1, **style_line)
    axes.legend(loc="lower left")
