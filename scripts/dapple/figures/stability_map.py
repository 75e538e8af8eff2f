"""Figures of the stability map: a heat map of all stressors, and curves over their levels."""

import numpy as np
import pandas as pd
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from dapple.figures import style
from dapple.stability import thresholds
from dapple.stability.stressors import STRESSORS

PANELS = ("polygons", "surfels", "voxels_0.2", "voxels_1.0", "virtual_leaves")
CLASSIFIERS = {"threshold": "reflectance threshold", "geometry": "geometry"}
COLOUR_MAP = "cividis"
COLUMNS = 4


def _level_order(points: pd.DataFrame, stressor: str) -> pd.DataFrame:
    """Levels of a stressor from harmless to broken: label, harmless, by level."""
    runs = points[points["stressor"] == stressor]
    levels = runs.groupby("level")[["label", "harmless"]].first().reset_index()
    at = int(np.argmax(levels["harmless"].astype(bool)))
    order = sorted(range(len(levels)), key=lambda k: (abs(k - at), k > at))
    return levels.iloc[order].reset_index(drop=True)


@style.styled
def heat_map(points: pd.DataFrame) -> Figure:
    """Median r over seeds by stressor and level, a panel a reconstruction; a cross marks failure.

    Parameters
    ----------
    points : DataFrame
        All runs, as in `stability/points.csv`.

    Returns
    -------
    Figure
        Levels run from harmless (left) to broken; two-sided stressors alternate between sides.
        The last panel is F1 of wood by both classifiers.
    """
    points = thresholds.against_harmless(points)
    points = points.assign(has_failed=thresholds.has_failed(points))
    names = [name for name in STRESSORS if (points["stressor"] == name).any()]
    panels = [name for name in PANELS if (points["reconstruction"] == name).any()]
    titles = [style.label(name) for name in panels] + [
        f"F1 of wood, {label}" for label in CLASSIFIERS.values()
    ]
    levels = {name: _level_order(points, name) for name in names}
    width = max(len(table) for table in levels.values())
    per_row = 2  # what stands in the cells can be read in print
    n_rows = -(-len(titles) // per_row)
    figure = style.new_figure(4.9 * per_row, (0.42 * len(names) + 0.8) * n_rows)
    grid = figure.subplots(n_rows, per_row, sharey=True, squeeze=False)
    for ax in grid.ravel()[len(titles) :]:
        ax.set_visible(False)
    axes = grid.ravel()[: len(titles)]
    for index, (ax, title) in enumerate(zip(axes, titles, strict=True)):
        if index < len(panels):
            runs, column = points[points["reconstruction"] == panels[index]], "r"
        else:
            kind = list(CLASSIFIERS)[index - len(panels)]
            runs, column = points[points["reconstruction"] == panels[0]], f"f1_wood_{kind}"
        values, labels, failed = _cells(runs, levels, names, width, column)
        norm = TwoSlopeNorm(0.8, 0.3, 1.0) if column == "r" else None
        image = ax.imshow(
            np.ma.masked_invalid(values), cmap=COLOUR_MAP, norm=norm, aspect="auto",
            **({} if norm else {"vmin": 0, "vmax": 1}),
        )  # fmt: skip
        _write(ax, values, labels, failed if column == "r" else None, norm)
        ax.grid(False)
        ax.set(title=title, xticks=[], yticks=range(len(names)))
        ax.set_yticklabels([STRESSORS[name].title for name in names])
        ax.tick_params(length=0)
        if index % per_row == per_row - 1 or index == len(titles) - 1:
            figure.colorbar(image, ax=ax, label="r" if column == "r" else "F1", shrink=0.8)
    return figure


def _cells(runs, levels, names, width, column):
    """Values, labels and failures (n, width) of one panel."""
    values = np.full((len(names), width), np.nan)
    labels = np.full((len(names), width), "", object)
    failed = np.zeros((len(names), width), bool)
    for row, name in enumerate(names):
        mine = runs[runs["stressor"] == name].groupby("level")
        middle, share = mine[column].median(), mine["has_failed"].mean()
        for k, level in enumerate(levels[name].itertuples()):
            labels[row, k] = str(level.label)
            values[row, k] = middle.get(level.level, np.nan)
            failed[row, k] = share.get(level.level, 0) > 0.5
    return values, labels, failed


def _write(ax, values, labels, failed, norm) -> None:
    """Label every cell with its level and value."""
    for (row, k), value in np.ndenumerate(values):
        if not labels[row, k]:
            continue
        lightness = (norm(value) if norm else value) if np.isfinite(value) else 1.0
        colour = "white" if lightness < 0.5 else "black"
        number = f"{value:.2f}" if np.isfinite(value) else "none"
        mark = " ✕" if failed is not None and failed[row, k] else ""
        size = 7.6 if len(labels[row, k]) < 8 else 5.8  # words are longer than numbers
        label = labels[row, k].replace(" ", "\n", 1) if len(labels[row, k]) > 9 else labels[row, k]
        ax.text(k, row - 0.21, label, ha="center", va="center", fontsize=size,
                color=colour, linespacing=0.9)  # fmt: skip
        ax.text(k, row + 0.22, f"{number}{mark}", ha="center", va="center", fontsize=7.6,
                color=colour, weight="bold" if mark else "normal")  # fmt: skip


@style.styled
def curves(points: pd.DataFrame) -> Figure:
    """r of all reconstructions over the levels of each stressor; shades span the seeds.

    Parameters
    ----------
    points : DataFrame
        All runs, as in `stability/points.csv`.
    """
    names = [name for name in STRESSORS if (points["stressor"] == name).any()]
    panels = [name for name in PANELS if (points["reconstruction"] == name).any()]
    n_rows = -(-len(names) // COLUMNS)
    figure = style.new_figure(9.8, 2.4 * n_rows + 0.4)
    grid = figure.subplots(n_rows, COLUMNS, squeeze=False, sharey=True)
    for ax in grid.ravel()[len(names) :]:
        ax.set_visible(False)
    for ax, name in zip(grid.ravel(), names, strict=False):
        runs = points[points["stressor"] == name]
        levels = runs.groupby("level")[["label", "harmless"]].first()
        for reconstruction in panels:
            by = runs[runs["reconstruction"] == reconstruction].groupby("level")["r"]
            over = by.agg(["median", "min", "max"]).reindex(levels.index)
            colour = style.colour(reconstruction, PANELS)
            at = np.arange(len(over))
            ax.fill_between(at, over["min"], over["max"], color=colour, alpha=0.2, lw=0)
            ax.plot(
                at, over["median"], "o-", ms=2.5, color=colour, label=style.label(reconstruction)
            )
        harmless = int(np.argmax(levels["harmless"].astype(bool)))
        ax.axvline(harmless, color="#BBBBBB", lw=3, zorder=0)
        ax.set_title(STRESSORS[name].title, fontsize=8)
        turned = {"rotation": 20, "ha": "right"} if max(map(len, levels["label"])) > 6 else {}
        ax.set_xticks(range(len(levels)), levels["label"], fontsize=7.6, **turned)
        ax.grid(axis="x", visible=False)
    for ax in grid[:, 0]:
        ax.set_ylabel("r")
    lowest = np.floor(10 * max(points["r"].min(), 0)) / 10
    grid[0, 0].set_ylim(lowest, 1.0)
    grid[0, 0].legend(fontsize=7.6, loc="lower right")
    return figure
