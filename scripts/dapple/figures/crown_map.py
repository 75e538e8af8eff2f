"""Crowns that were found, and the facets that stand for them, beside the scanner's points."""

import numpy as np
from matplotlib.figure import Figure

from dapple.cloud.crowns import outlines
from dapple.figures import style
from dapple.formats.rasters import Raster

MOST_POINTS = 40_000


@style.styled
def crowns(
    height: Raster, labels: Raster, points_m: np.ndarray, facets_m: np.ndarray, slice_m: float
) -> Figure:
    """Draw a map of canopy heights with the outlines of crowns, and slices seen from the south.

    Parameters
    ----------
    height, labels : Raster
        Canopy height; band "crown" of the crowns.
    points_m, facets_m : (n, 3) float64
        Points of the cloud and centres of facets, world coordinates [m].
    slice_m : float
        Depth of the slice through the middle of the map [m].
    """
    figure = style.new_figure(9.6, 4.6)
    above, side, filled = figure.subplot_mosaic(
        [["map", "points"], ["map", "facets"]], width_ratios=[1, 1.5]
    ).values()
    extent = [0, height.right_m - height.left_m, 0, height.top_m - height.bottom_m]
    shown = above.imshow(height.values[0], extent=extent, cmap="viridis", interpolation="nearest")
    figure.colorbar(shown, ax=above, label="canopy height [m]", shrink=0.7)
    edge = outlines(np.nan_to_num(labels.values[labels.bands.index("crown")]).astype(int))
    above.imshow(
        np.ma.masked_equal(edge, False), extent=extent, cmap="autumn", interpolation="nearest"
    )
    above.set(title="Crowns", xlabel="east [m]", ylabel="north [m]")
    above.grid(False)
    corner = np.array([height.left_m, height.bottom_m, points_m[:, 2].min()])
    middle = 0.5 * (height.bottom_m + height.top_m)
    for axes, places, title, colour in (
        (side, points_m, "Points", "#555555"),
        (filled, facets_m, "Facets", style.LEAF),
    ):
        inside = np.abs(places[:, 1] - middle) <= 0.5 * slice_m
        chosen = places[inside] - corner
        chosen = chosen[:: 1 + len(chosen) // MOST_POINTS]
        axes.scatter(chosen[:, 0], chosen[:, 2], s=0.4, color=colour, linewidths=0)
        axes.set(title=f"{title}, a slice {slice_m:g} m deep", ylabel="up [m]", aspect="equal")
    filled.sharex(side)
    filled.sharey(side)
    filled.set_xlabel("east [m]")
    return figure
