"""Figures of a scan survey."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from dapple.figures import style

COLOURS = {
    "single": "#0072B2",
    "diamond": "#D55E00",
    "corners": "#009E73",
    "list": "#7A5C00",
    "planner": "#CC79A7",
    "random": "#8C8C8C",
}
_TRUTH = "#1A1A1A"


@style.styled
def shadowing(table: pd.DataFrame) -> Figure:
    """Relative shadow against the number of beams; the shade is the range over seeds."""
    stands = list(dict.fromkeys(table["stand"]))
    figure = style.new_figure(3.6 * len(stands), 3.2)
    axes = figure.subplots(1, len(stands), sharey=True, squeeze=False)[0]
    for ax, stand in zip(axes, stands, strict=True):
        for design, rows in table[table["stand"] == stand].groupby("design", sort=False):
            over = rows.groupby("n_beams")["rs"].agg(["mean", "min", "max"]) * 100
            ax.fill_between(over.index / 1e6, over["min"], over["max"],
                            color=COLOURS[design], alpha=0.2, lw=0)  # fmt: skip
            ax.plot(over.index / 1e6, over["mean"], "o-", ms=3, color=COLOURS[design], label=design)
        ax.set(xscale="log", xlabel="beams of the whole design [million]", title=stand.title())
        beams = np.unique(table["n_beams"]) / 1e6
        ax.set_xticks(beams, [f"{n:.2g}" for n in beams])
        ax.minorticks_off()
    axes[0].set(ylabel="relative shadow [%]", ylim=(0, 100))
    axes[0].legend()
    return figure


@style.styled
def filled_profiles(table: pd.DataFrame, layer_m: float = 1.0) -> Figure:
    """Number of filled voxels by height: truly, hit, and reached by some beam (finest scans)."""
    first = table[table["seed"] == table["seed"].min()]
    pairs = list(dict.fromkeys(zip(first["stand"], first["design"], strict=True)))
    stands = list(dict.fromkeys(stand for stand, _ in pairs))
    n = max(sum(s == stand for s, _ in pairs) for stand in stands)
    figure = style.new_figure(2.4 * n, 3.2 * len(stands))
    grid = figure.subplots(len(stands), n, sharex=True, sharey=True, squeeze=False)
    place = dict.fromkeys(stands, 0)
    for stand, design in pairs:
        ax = grid[stands.index(stand), place[stand]]
        place[stand] += 1
        rows = first[(first["stand"] == stand) & (first["design"] == design)]
        rows = rows[rows["n_beams"] == rows["n_beams"].max()]
        layer = np.floor(rows["height_m"] / layer_m)
        by = rows.groupby((layer + 0.5) * layer_m)[["true", "hit", "reached"]].sum() / 1e3
        ax.plot(by["true"], by.index, color=_TRUTH, label="truth")
        ax.plot(by["reached"], by.index, color=COLOURS[design], ls="--", label="reached")
        ax.plot(by["hit"], by.index, color=COLOURS[design], label="hit")
        ax.set_title(f"{stand.title()}, {design}")
    for ax in grid[-1]:
        ax.set_xlabel(f"filled voxels per {layer_m:g} m [1000]")
    for ax in grid[:, 0]:
        ax.set_ylabel("height [m]")
    grid[0, 0].legend()
    return figure


@style.styled
def shadow_maps(maps: Mapping[str, np.ndarray], cell_size_m: float) -> Figure:
    """Relative shadow seen from above, by stand and design (rows) and third of height."""
    names = list(dict.fromkeys(key.rsplit("/", 1)[0] for key in maps))
    figure = style.new_figure(6.6, 2.05 * len(names))
    grid = figure.subplots(len(names), 3, sharex=True, sharey=True, squeeze=False)
    for row, name in zip(grid, names, strict=True):
        for level, ax in enumerate(row):
            values = 100 * np.asarray(maps[f"{name}/{level}"])
            reach = [0, values.shape[0] * cell_size_m, 0, values.shape[1] * cell_size_m]
            image = ax.imshow(values.T, origin="lower", extent=reach, vmin=0, vmax=100,
                              cmap="cividis")  # fmt: skip
            ax.grid(False)
        stand, _, design = name.partition("/")
        row[0].set_ylabel(f"{stand}, {design}\n[m]")
    for ax, third in zip(grid[0], ("lower", "middle", "upper"), strict=True):
        ax.set_title(f"{third} third")
    for ax in grid[-1]:
        ax.set_xlabel("[m]")
    figure.colorbar(image, ax=grid, label="relative shadow [%]", shrink=0.5)
    return figure


@style.styled
def regressions(table: pd.DataFrame) -> Figure:
    """Slope and R² of contact frequency on the true share of filled voxels, by coverage."""
    stands = list(dict.fromkeys(table["stand"]))
    classes = list(dict.fromkeys(table["coverage_class"]))
    figure = style.new_figure(3.6 * len(stands), 4.6)
    grid = figure.subplots(2, len(stands), sharex=True, sharey="row", squeeze=False)
    for column, stand in enumerate(stands):
        for design, rows in table[table["stand"] == stand].groupby("design", sort=False):
            rows = rows.set_index("coverage_class").reindex(classes)
            for ax, key in zip(grid[:, column], ("slope", "r2"), strict=True):
                ax.plot(classes, rows[key], "o-", ms=3, color=COLOURS[design], label=design)
        grid[0, column].set_title(stand.title())
        grid[1, column].set_xlabel("voxels reached [%]")
        grid[1, column].set_ylim(-0.1, 1)
    grid[0, 0].set_ylabel("slope")
    grid[1, 0].set_ylabel("R²")
    grid[0, 0].legend()
    return figure


@style.styled
def corrected_profiles(table: pd.DataFrame) -> Figure:
    """True, measured and corrected share of filled voxels by height, mean over seeds."""
    stands, designs = (list(dict.fromkeys(table[key])) for key in ("stand", "design"))
    figure = style.new_figure(2.4 * len(designs), 3.2 * len(stands))
    grid = figure.subplots(len(stands), len(designs), sharex="row", sharey=True, squeeze=False)
    for i, stand in enumerate(stands):
        for j, design in enumerate(designs):
            rows = table[(table["stand"] == stand) & (table["design"] == design)]
            mean = rows.groupby("height_m").mean(numeric_only=True)
            ax = grid[i, j]
            ax.plot(mean["true_share"], mean.index, color=_TRUTH, label="truth")
            ax.plot(mean["measured_share"], mean.index, color=COLOURS[design], ls=":",
                    label="contact frequency")  # fmt: skip
            ax.plot(mean["corrected_share"], mean.index, color=COLOURS[design], label="corrected")
            ax.set_title(f"{stand.title()}, {design}")
        grid[i, 0].set_ylabel("height [m]")
    for ax in grid[-1]:
        ax.set_xlabel("share of voxels filled")
    grid[0, 0].legend()
    return figure


@style.styled
def plan(table: pd.DataFrame) -> Figure:
    """Relative shadow against the number of scans, for planner, designs and chance."""
    stands = list(dict.fromkeys(table["stand"]))
    figure = style.new_figure(3.6 * len(stands), 3.2)
    axes = figure.subplots(1, len(stands), sharey=True, squeeze=False)[0]
    for ax, stand in zip(axes, stands, strict=True):
        for name, rows in table[table["stand"] == stand].groupby("planner", sort=False):
            mean = 100 * rows.groupby("n_scans")["rs"].mean()
            ax.plot(mean.index, mean, "o-", ms=3, color=COLOURS[name], label=name)
        ax.set(xlabel="scans", title=stand.title())
    axes[0].set_ylabel("relative shadow [%]")
    axes[0].legend()
    return figure
