"""One look for all figures: colours that everyone can tell apart, quiet axes, the same bytes."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from dapple.formats.atomic import atomic

DPI = 150
PAR_UNIT = "µmol m⁻² s⁻¹"

# Okabe and Ito (2008): distinct for the common kinds of colour blindness.
COLOURS = {
    "truth": "#009E73",
    "polygons": "#0072B2",
    "surfels": "#5B3A8C",
    "voxels_0.2": "#E69F00",
    "voxels_1.0": "#CC79A7",
    "measured": "#1A1A1A",
    "baseline": "#8C8C8C",
}
SPARE_COLOURS = ("#D55E00", "#56B4E9", "#7A5C00")
LEAF, WOOD, SENSOR, SCANNER = "#5C9A3B", "#7A5638", "#C03A2B", "#3B3F8F"
LIGHT_MAP = "cividis"
# From a yellow that shows on white.
DENSITY_MAP = ListedColormap(mpl.colormaps["YlGn"](np.linspace(0.18, 1, 256)), "density")
COUNT_MAP = ListedColormap(mpl.colormaps["YlGnBu"](np.linspace(0.3, 1, 256)), "count")
NOTHING_BUT_THE_PICTURE: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "pdf": {"Creator": None, "Producer": None, "CreationDate": None},
}

SETTINGS = {
    "font.family": "DejaVu Sans",  # comes with Matplotlib: the same glyphs on every machine
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelcolor": "#222222",
    "ytick.labelcolor": "#222222",
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.2,
    "figure.facecolor": "white",
    "savefig.dpi": DPI,
}


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Run a drawing function under the shared settings, whatever the caller's own are."""

    @wraps(draw)
    def drawn(*arguments, **options) -> Figure:
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(SETTINGS)
            return draw(*arguments, **options)

    return drawn


def colour(reconstruction: str, others: tuple[str, ...] = ()) -> str:
    """The fixed colour of a reconstruction; unknown names take spare colours by their order."""
    if reconstruction in COLOURS:
        return COLOURS[reconstruction]
    unknown = [name for name in others if name not in COLOURS]
    index = unknown.index(reconstruction) if reconstruction in unknown else 0
    return SPARE_COLOURS[index % len(SPARE_COLOURS)]


def label(reconstruction: str) -> str:
    """A reconstruction's name as a person would write it."""
    if reconstruction.startswith("voxels_"):
        size, _, kind = reconstruction.removeprefix("voxels_").partition("_")
        return f"voxels {size} m {kind.replace('_', ' ')}".strip()
    return reconstruction.replace("_", " ")


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that lays itself out; it belongs to no window and no global state."""
    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")


def save_both(figure: Figure, path: str | Path) -> None:
    """Write a picture as PNG, for the screen, and beside it as PDF, for print."""
    for kind in (".png", ".pdf"):
        save(figure, Path(path).with_suffix(kind))


def save(figure: Figure, path: str | Path) -> None:
    """Write a picture, PNG or PDF by its name, that holds no date and no version of a program."""
    with atomic(path) as partial, mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS)
        kind = partial.suffix.removeprefix(".")
        figure.savefig(partial, format=kind, dpi=DPI, metadata=NOTHING_BUT_THE_PICTURE[kind])
