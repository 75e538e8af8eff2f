"""Figures of leaf chlorophyll from UAV images."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from dapple.figures import style

UNIT = "µg cm⁻²"
CHLOROPHYLL_MAP = "YlGn"
COLOURS = {"collision_orders": "#0072B2", "semi_less": "#D55E00", "prosail": "#7A5C00"}
KIND_COLOURS = {"sunlit": "#E69F00", "shaded": "#3B3F8F", "all": "#5C9A3B"}
LABELS = {
    "collision_orders": "collision orders",
    "semi_less": "Semi-LESS",
    "prosail": "PROSAIL",
    "sunlit": "sunlit pixels",
    "all": "all pixels",
    "robust": "robust",
    "published": "as published",
}
RANGE_UG_CM2 = (0.0, 80.0)


def _rows(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Pairs of mask and kind of network, in their order."""
    return list(dict.fromkeys(zip(table["mask"], table["network"], strict=True)))


def _of(table: pd.DataFrame, row: tuple[str, str], model: str) -> pd.DataFrame:
    mask, network = row
    return table[
        (table["mask"] == mask) & (table["network"] == network) & (table["model"] == model)
    ]


def _title(row: tuple[str, str], model: str) -> str:
    mask, network = row
    return f"{LABELS[model]}, {LABELS[mask]}\n{LABELS[network]}"


def _grid(rows: Sequence, columns: Sequence, width_in: float, height_in: float):
    figure = style.new_figure(width_in * len(columns) + 0.9, height_in * len(rows) + 0.2)
    panels = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
    return figure, panels


def _numbers(axes: Axes, scores: Mapping) -> None:
    axes.text(
        0.03, 0.97,
        f"R² = {scores['r2']:.2f}\nRMSE = {scores['rmse']:.1f}\nn = {scores['n']:.0f}",
        transform=axes.transAxes, va="top", fontsize=8,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 2},
    )  # fmt: skip


def _equality(axes: Axes) -> None:
    axes.plot(RANGE_UG_CM2, RANGE_UG_CM2, color="#222222", lw=0.8, ls=(0, (4, 3)))
    axes.set(xlim=RANGE_UG_CM2, ylim=RANGE_UG_CM2, aspect="equal")


@style.styled
def simulated(tests: pd.DataFrame, accuracy: pd.DataFrame, *, cells: int = 40) -> Figure:
    """Predictions of simulated entries against their truth, by model, mask and network.

    Parameters
    ----------
    tests : DataFrame
        `model, mask, network, truth_ug_cm2, predicted_ug_cm2`.
    accuracy : DataFrame
        Scores of the same `model, mask, network`, written into the panels.
    cells : int
        Hexagons along one axis.
    """
    rows, models = _rows(tests), list(dict.fromkeys(tests["model"]))
    figure, panels = _grid(rows, models, 2.4, 2.6)
    drawn = []
    for i, row in enumerate(rows):
        for j, model in enumerate(models):
            own = _of(tests, row, model)
            axes = panels[i, j]
            drawn.append(
                axes.hexbin(
                    own["truth_ug_cm2"], own["predicted_ug_cm2"],
                    gridsize=(cells, int(cells / np.sqrt(3))), extent=RANGE_UG_CM2 * 2,
                    mincnt=1, cmap=style.COUNT_MAP, linewidths=0.1,
                )
            )  # fmt: skip
            _equality(axes)
            axes.set_title(_title(row, model))
            scores = _of(accuracy, row, model)
            if len(scores):
                _numbers(axes, scores.iloc[0])
    top = max((hexes.get_array().max() for hexes in drawn if len(hexes.get_array())), default=1)
    norm = LogNorm(1, max(2.0, top))
    for hexes in drawn:
        hexes.set_norm(norm)
    figure.colorbar(drawn[0], ax=panels, shrink=0.6, label="entries").outline.set_visible(False)
    figure.supxlabel(f"chlorophyll of the simulated leaf [{UNIT}]", fontsize=9)
    figure.supylabel(f"predicted [{UNIT}]", fontsize=9)
    return figure


@style.styled
def field(trees: pd.DataFrame, accuracy: pd.DataFrame) -> Figure:
    """Predictions of trees against their known chlorophyll, by model, mask and network.

    Parameters
    ----------
    trees : DataFrame
        `model, mask, network, truth_ug_cm2, predicted_ug_cm2, low_ug_cm2, high_ug_cm2`.
    accuracy : DataFrame
        Scores of the same `model, mask, network`, written into the panels.
    """
    trees = trees[np.isfinite(trees["truth_ug_cm2"].astype(float))]
    if trees.empty:
        return _nothing_known()
    rows, models = _rows(trees), list(dict.fromkeys(trees["model"]))
    figure, panels = _grid(rows, models, 2.4, 2.6)
    for i, row in enumerate(rows):
        for j, model in enumerate(models):
            own = _of(trees, row, model)
            axes = panels[i, j]
            axes.vlines(own["truth_ug_cm2"], own["low_ug_cm2"], own["high_ug_cm2"],
                        color=COLOURS[model], alpha=0.25, lw=1)  # fmt: skip
            axes.plot(own["truth_ug_cm2"], own["predicted_ug_cm2"], "o", ms=3.5,
                      color=COLOURS[model], mec="white", mew=0.4)  # fmt: skip
            _equality(axes)
            axes.set_title(_title(row, model))
            scores = _of(accuracy, row, model)
            if len(scores):
                _numbers(axes, scores.iloc[0])
    figure.supxlabel(f"chlorophyll of the tree [{UNIT}]", fontsize=9)
    figure.supylabel(f"retrieved, with its interval [{UNIT}]", fontsize=9)
    return figure


def _nothing_known() -> Figure:
    figure = style.new_figure(7.0, 1.2)
    figure.text(0.5, 0.5, "No tree has measured chlorophyll: the map is not held against any.",
                ha="center", va="center", fontsize=9)  # fmt: skip
    return figure


@style.styled
def spectra(pixels: pd.DataFrame, simulated: pd.DataFrame) -> Figure:
    """Reflectance of sunlit, shaded and all canopy pixels.

    Parameters
    ----------
    pixels : DataFrame
        Observed: `kind` (sunlit, shaded, all), `wavelength_nm`, `mean`, `deviation`.
    simulated : DataFrame
        `model, mask, wavelength_nm, low, middle, high`: quantiles of the training entries.
    """
    figure = style.new_figure(7.0, 3.1)
    left, right = figure.subplots(1, 2, sharey=True)
    for kind, rows in pixels.groupby("kind", sort=False):
        left.errorbar(rows["wavelength_nm"], rows["mean"], rows["deviation"], fmt="o-", ms=3.5,
                      capsize=2, lw=1, color=KIND_COLOURS[kind], label=kind)  # fmt: skip
    left.set(title="observed canopy pixels", xlabel="wavelength [nm]", ylabel="reflectance")
    left.legend()
    taught = list(dict.fromkeys(simulated["mask"]))
    mask = "sunlit" if "sunlit" in taught or not taught else taught[0]
    observed = pixels[pixels["kind"] == mask]
    shift = -6.0
    for model, rows in simulated[simulated["mask"] == mask].groupby("model", sort=False):
        right.errorbar(
            rows["wavelength_nm"] + shift, rows["middle"],
            [rows["middle"] - rows["low"], rows["high"] - rows["middle"]], fmt="o", ms=3,
            capsize=2, lw=1, color=COLOURS[model], label=f"{LABELS[model]}, 5 to 95 %",
        )  # fmt: skip
        shift += 6.0
    right.plot(observed["wavelength_nm"], observed["mean"], color=KIND_COLOURS[mask], lw=1.5,
               label="observed mean")  # fmt: skip
    right.set(title=f"training entries of {LABELS[mask]}", xlabel="wavelength [nm]", ylim=(0, None))
    right.legend()
    return figure


@style.styled
def losses(histories: pd.DataFrame) -> Figure:
    """Loss by epoch, training and validation, one line per seed.

    Parameters
    ----------
    histories : DataFrame
        `model, mask, network, seed, epoch, train_loss, validation_loss`.
    """
    pairs, models = _rows(histories), list(dict.fromkeys(histories["model"]))
    figure, panels = _grid(pairs, models, 2.4, 1.9)
    for i, pair in enumerate(pairs):
        for j, model in enumerate(models):
            axes = panels[i, j]
            own = _of(histories, pair, model)
            for seed, rows in own.groupby("seed"):
                first = seed == own["seed"].min()
                for key, colour in (("train_loss", "#8C8C8C"), ("validation_loss", COLOURS[model])):
                    label = key.removesuffix("_loss").replace("train", "training")
                    axes.plot(rows["epoch"], rows[key], color=colour, lw=0.9,
                              label=label if first else None)  # fmt: skip
            axes.set(yscale="log")
            axes.set_title(_title(pair, model))
    panels[0, 0].legend()
    figure.supxlabel("epoch", fontsize=9)
    figure.supylabel("mean squared error of scaled targets", fontsize=9)
    return figure


@style.styled
def chlorophyll_map(
    values: np.ndarray,
    *,
    cell_m: float,
    size_m: tuple[float, float],
    rings: Sequence[np.ndarray] = (),
    truth: Sequence[float] = (),
) -> Figure:
    """Retrieved chlorophyll, width of its interval and cells unlike any simulation.

    Parameters
    ----------
    values : (5, rows, columns) float
        Layers of `retrieval.maps.MAP_BANDS`.
    cell_m : float
        Edge of a cell [m].
    size_m : two floats
        Extent east and north of the images [m], where the last cells may be cut.
    rings : sequence of (k, 2) arrays
        Outlines of crowns, from the south-west corner of the images east and north [m].
    truth : sequence of float
        Their chlorophyll, which fills them in the first panel's colours; NaN: only an outline.
    """
    figure = style.new_figure(8.6, 0.9 + 3.3 * size_m[1] / size_m[0])
    left, right = figure.subplots(1, 2)
    _, rows, columns = values.shape
    reach = [0, columns * cell_m, size_m[1] - rows * cell_m, size_m[1]]
    lcc, low, high, _, outside = values
    shown = left.imshow(lcc, extent=reach, vmin=10, vmax=70, cmap=CHLOROPHYLL_MAP)
    figure.colorbar(shown, ax=left, label=f"leaf chlorophyll [{UNIT}]", shrink=0.85)
    for ring, true in zip(rings, truth, strict=True):
        colour = shown.cmap(shown.norm(true))
        left.fill(*np.asarray(ring).T, facecolor=colour, edgecolor="#1A1A1A", lw=0.8)
    width = right.imshow(high - low, extent=reach, vmin=0, cmap="cividis")
    figure.colorbar(width, ax=right, label=f"width of the interval [{UNIT}]", shrink=0.85)
    row, column = np.nonzero(np.nan_to_num(outside) > 0)
    north = size_m[1] - (row + 0.5) * cell_m
    right.plot((column + 0.5) * cell_m, north, "x", ms=4, color="#D55E00",
               label="beyond the training range")  # fmt: skip
    if len(row):
        right.legend(loc="lower left", frameon=True, fontsize=7)
    known = np.isfinite(np.asarray(truth, float)).any()
    left.set_title("retrieved, and crowns with what is known of them" if known else "retrieved")
    right.set_title("how far to trust it")
    for axes in (left, right):
        axes.grid(False)
        axes.set(xlim=(0, size_m[0]), ylim=(0, size_m[1]), aspect="equal",
                 xlabel="east [m]", ylabel="north [m]")  # fmt: skip
    return figure
