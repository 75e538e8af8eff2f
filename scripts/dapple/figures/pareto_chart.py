"""Accuracy against speed, as a picture and as a page that answers to the mouse."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from plotly.subplots import make_subplots

from dapple.advice.tradeoff import front
from dapple.figures import style
from dapple.formats import tables

MARKERS = {
    "transport": ("o", "circle"),
    "timestep": ("s", "square"),
    "less": ("^", "triangle-up"),
}
ENGINES = {
    "transport": "transport engine",
    "timestep": "per-timestep Mitsuba",
    "less": "LESS 3, its start included",
}
SHADES = {
    "polygons": ("#003B5C", "#0072B2", "#56A6D8", "#9CCBEB"),
    "surfels": ("#5B3A8C",),
    "voxels": ("#7A5C00", "#E69F00", "#D55E00", "#CC79A7"),
}
FRONT_COLOUR = "#1A1A1A"
LABEL_GAP = 0.045
"""Least distance of labels, as a share of the panel's height."""
LABEL_WIDTH, LABEL_SHIFT = 0.18, 0.03
"""Of a label, and from its point: shares of the panel's width."""


def groups(points: pd.DataFrame) -> list[tuple[str, str, str, pd.DataFrame]]:
    """Points of one geometry and engine: label, colour, engine, rows by cost."""
    shades: dict[tuple[str, Any], str] = {}
    for kind, palette in SHADES.items():
        sizes = sorted(points.loc[points["reconstruction"].str.startswith(kind), "size_m"].unique())
        shades |= {(kind, size): palette[k % len(palette)] for k, size in enumerate(sizes)}
    found = []
    for (engine, name, size), own in points.groupby(["engine", "reconstruction", "size_m"]):
        kind = name.split("_")[0]
        length = f"{100 * size:g} cm" if size < 0.1 or kind != "voxels" else f"{size:g} m"
        label = f"{kind} {length}"
        found.append((label, shades[kind, size], engine, own.sort_values("cost_s")))
    return found


def _titles(points: pd.DataFrame) -> tuple[str, str]:
    reference = points["reference"].iloc[0]
    known = "the true plant's light" if reference == "truth" else f"the {reference}"
    return f"Error against {known}", "Error of rays, patches and orders alone"


def _cost_title(points: pd.DataFrame) -> str:
    return (
        f"wall time for {points['n_sensors'].iloc[0]} sensors × "
        f"{points['n_times'].iloc[0]} times [s], kernels compiled"
    )


ERRORS = ("error_rel", "error_finest_rel")
ERROR_TITLE = "RMSE as a share of open-sky PAR"


def of_run(inputs: Mapping[str, Any], options: Mapping[str, Any]) -> Figure:
    """From the files of a run: `points` of the trade-off."""
    return draw(tables.read(inputs["points"]))


@style.styled
def draw(points: pd.DataFrame) -> Figure:
    """Two panels on logarithmic axes, the front and every geometry labelled.

    Parameters
    ----------
    points : DataFrame
        As `advice.tradeoff.table` makes it.
    """
    figure = style.new_figure(9.6, 5.0)
    panels = figure.subplots(1, 2)
    for axes, error, title in zip(panels, ERRORS, _titles(points), strict=True):
        _panel(axes, points, error)
        axes.set_title(title)
        axes.set_xlabel(_cost_title(points))
    panels[0].set_ylabel(ERROR_TITLE)
    _legend(panels[1], set(points["engine"]))
    return figure


def _panel(axes: Axes, points: pd.DataFrame, error: str) -> None:
    axes.set(xscale="log", yscale="log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 5, 7)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:g} %"))
    labels = []
    for label, colour, engine, own in groups(points):
        ladder = _ladder(own)
        axes.plot(ladder["cost_s"], ladder[error], color=colour, linewidth=1, alpha=0.7)
        axes.scatter(
            own["cost_s"],
            own[error],
            s=[26 if row in ladder.index else 9 for row in own.index],
            marker=MARKERS[engine][0],
            color=colour,
            edgecolor="white",
            linewidth=0.4,
            zorder=3,
        )
        last = ladder.iloc[-1]
        labels.append((label, colour, last["cost_s"], last[error]))
    best = points[front(points["cost_s"], points[error])].sort_values("cost_s")
    axes.plot(best["cost_s"], best[error], color=FRONT_COLOUR, linewidth=0.8, linestyle=(0, (4, 2)))
    low, high = axes.get_xlim()
    axes.set_xlim(low, high * (high / low) ** 0.33)
    low, high = axes.get_ylim()
    axes.set_ylim(low / (high / low) ** 0.18, high)
    labels.sort(key=lambda one: -one[3])
    _label(axes, labels, points[["cost_s", error]].to_numpy())


def _ladder(own: pd.DataFrame) -> pd.DataFrame:
    """Points that differ in their number of rays alone: with the most patches and orders."""
    own = own.sort_values("paths")
    if own["engine"].iloc[0] != "transport":
        return own
    finest = own[["sky_patches", "max_orders"]].max()
    return own[
        (own["sky_patches"] == finest["sky_patches"]) & (own["max_orders"] == finest["max_orders"])
    ]


def _label(axes: Axes, labels: list[tuple[str, str, float, float]], points: np.ndarray) -> None:
    """Names at the dear end of every ladder, above the foot of an axis that is long enough."""
    placed = _placed(axes, labels, points)
    while min(y for _, y in placed) < LABEL_GAP:
        low, high = axes.get_ylim()
        axes.set_ylim(low / (high / low) ** 0.05, high)
        placed = _placed(axes, labels, points)
    for (label, colour, cost, error), place in zip(labels, placed, strict=True):
        axes.annotate(
            label,
            (cost, error),
            xytext=place,
            textcoords=axes.transAxes,
            va="center",
            fontsize=7.5,
            color=colour,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.4, "alpha": 0.6},
        )


def _placed(
    axes: Axes, labels: list[tuple[str, str, float, float]], points: np.ndarray
) -> list[tuple[float, float]]:
    """Where labels stand, in parts of the axes: moved down to where nothing else is."""
    to_axes = axes.transData + axes.transAxes.inverted()
    taken = to_axes.transform(points)
    placed: list[tuple[float, float]] = []
    for _, _, cost, error in labels:
        x, y = to_axes.transform((cost, error))
        x += LABEL_SHIFT
        right = x + LABEL_WIDTH
        while (
            (taken[:, 0] > x) & (taken[:, 0] < right) & (abs(taken[:, 1] - y) < LABEL_GAP / 2)
        ).any() or any(
            abs(other_x - x) < LABEL_WIDTH and abs(other_y - y) < LABEL_GAP
            for other_x, other_y in placed
        ):
            y -= LABEL_GAP / 4
        placed.append((float(x), float(y)))
    return placed


def _legend(axes: Axes, engines: set[str]) -> None:
    for engine, (marker, _) in MARKERS.items():
        if engine in engines:
            axes.scatter([], [], marker=marker, color="#666666", s=26, label=ENGINES[engine])
    axes.scatter([], [], marker="o", color="#666666", s=9, label="fewer patches or orders")
    axes.plot(
        [], [], color=FRONT_COLOUR, linewidth=0.8, linestyle=(0, (4, 2)), label="Pareto front"
    )
    axes.legend(loc="best", fontsize=7.5)


def page(points: pd.DataFrame, title: str) -> str:
    """The same chart as one HTML page without links to other files.

    Parameters
    ----------
    points : DataFrame
        As `advice.tradeoff.table` makes it.
    title : str
        Of the page.
    """
    figure = to_explore(points).update_layout(title=title)
    return figure.to_html(include_plotlyjs=True, full_html=True, div_id="tradeoff")


def to_explore(points: pd.DataFrame) -> go.Figure:
    """The same chart, which answers to the mouse.

    Parameters
    ----------
    points : DataFrame
        As `advice.tradeoff.table` makes it.
    """
    figure = make_subplots(1, 2, subplot_titles=_titles(points), horizontal_spacing=0.08)
    for column, error in enumerate(ERRORS, 1):
        for label, colour, engine, own in groups(points):
            name = f"{label}, {ENGINES[engine]}"
            figure.add_trace(
                go.Scatter(
                    x=own["cost_s"],
                    y=own[error],
                    mode="markers",
                    name=name,
                    legendgroup=name,
                    showlegend=column == 1,
                    marker={"color": colour, "symbol": MARKERS[engine][1], "size": 8},
                    text=own["setting"],
                    customdata=own[["cpu_s", "compile_s"]],
                    hovertemplate="%{text}<br>error %{y:.2%}<br>%{x:.3g} s, "
                    "processor %{customdata[0]:.3g} s, compiling %{customdata[1]:.2g} s"
                    "<extra></extra>",
                ),
                1,
                column,
            )
        best = points[front(points["cost_s"], points[error])].sort_values("cost_s")
        figure.add_trace(
            go.Scatter(
                x=best["cost_s"],
                y=best[error],
                mode="lines",
                name="Pareto front",
                legendgroup="front",
                showlegend=column == 1,
                hoverinfo="skip",
                line={"color": FRONT_COLOUR, "dash": "dash", "width": 1},
            ),
            1,
            column,
        )
        figure.update_xaxes(type="log", title_text=_cost_title(points), row=1, col=column)
        figure.update_yaxes(type="log", tickformat=".2~%", row=1, col=column)
    figure.update_yaxes(title_text=ERROR_TITLE, row=1, col=1)
    return figure.update_layout(template="plotly_white", height=650, hovermode="closest")
