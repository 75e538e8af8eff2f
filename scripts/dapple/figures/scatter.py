"""Simulated against measured PAR, every record, one panel per reconstruction."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from dapple.figures import style
from dapple.formats import tables


def of_run(inputs: Mapping[str, Any], options: Mapping[str, Any]) -> Figure:
    """From `records` of a run, those that no fit has seen, and `overall`."""
    records = tables.read(inputs["records"])
    return draw(records[records["part"] == "reporting"], tables.read(inputs["overall"]))


@style.styled
def draw(records: pd.DataFrame, overall: pd.DataFrame, *, cells: int = 45) -> Figure:
    """Density of records, with the line of equality.

    Parameters
    ----------
    records : DataFrame
        `reconstruction, measured, simulated` [µmol m⁻² s⁻¹].
    overall : DataFrame
        `reconstruction, n, r, r_low, r_high, rmse, bias`, written into the panels.
    cells : int
        Hexagons along one axis.
    """
    names = tuple(records["reconstruction"].unique())
    columns = 2 if len(names) == 4 else min(len(names), 3)
    rows = -(-len(names) // columns)
    figure = style.new_figure(2.75 * columns + 1.1, 2.95 * rows + 0.3)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    complete = records.dropna(subset=["measured", "simulated"])
    top = 1.04 * float(complete[["measured", "simulated"]].max().max())
    drawn = []
    for axes, name in zip(panels, names, strict=False):
        own = complete[complete["reconstruction"] == name]
        drawn.append(_panel(axes, own, top, cells))
        axes.set_title(style.label(name), color=style.colour(name, names), fontweight="bold")
        _numbers(axes, overall[overall["reconstruction"] == name])
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    # One scale for all: the colours of two panels mean the same number of records.
    norm = LogNorm(1, max(2.0, max(hexes.get_array().max() for hexes in drawn)))
    for hexes in drawn:
        hexes.set_norm(norm)
    bar = figure.colorbar(drawn[0], ax=list(panels), shrink=0.8, pad=0.015)
    bar.set_label("records per cell")
    bar.outline.set_visible(False)
    figure.supxlabel(f"measured PAR [{style.PAR_UNIT}]", fontsize=9)
    figure.supylabel(f"simulated PAR [{style.PAR_UNIT}]", fontsize=9)
    return figure


def _panel(axes: Axes, own: pd.DataFrame, top: float, cells: int):
    hexes = axes.hexbin(
        own["measured"],
        own["simulated"],
        gridsize=(cells, int(cells / np.sqrt(3))),
        extent=(0, top, 0, top),
        mincnt=1,
        cmap=style.COUNT_MAP,
        linewidths=0.1,
    )
    axes.plot([0, top], [0, top], color="#222222", linewidth=0.8, linestyle=(0, (4, 3)))
    axes.set(xlim=(0, top), ylim=(0, top), aspect="equal")
    return hexes


def _numbers(axes: Axes, row: pd.DataFrame) -> None:
    if row.empty:
        return
    values = row.iloc[0]
    interval = ""
    if np.isfinite(values["r_low"]):
        interval = f" ({values['r_low']:.2f} to {values['r_high']:.2f})"
    axes.text(
        0.03,
        0.97,
        f"r = {values['r']:.2f}{interval}\nRMSE = {values['rmse']:.0f}\n"
        f"bias = {round(values['bias']) or 0:+d}\nn = {values['n']:.0f}",
        transform=axes.transAxes,
        va="top",
        fontsize=8,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 2},
    )
