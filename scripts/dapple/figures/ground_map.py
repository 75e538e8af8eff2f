"""PAR on the ground under the tree at a few times."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dapple.figures import style
from dapple.formats import meshes, netcdf
from dapple.structure.stem import stem_position
from dapple.times import spread


def of_run(inputs: Mapping[str, Any], options: Mapping[str, Any]) -> Figure:
    """From the files of a run: `map` and `wood`, where the stem is.

    Options are `times` to draw (none: four spread ones) and the `timezone` that they are in.
    """
    data = netcdf.read(inputs["map"])
    data = data.isel(time=spread(netcdf.times(data), options["times"], 4, options["timezone"]))
    sun = data[["sun_zenith_deg", "sun_azimuth_deg"]].to_dataframe()
    stem = stem_position(meshes.read_ply(inputs["wood"]))
    return draw(data["par_umol_m2_s"], stem_m=tuple(stem[:2]), sun=sun)


@style.styled
def draw(
    par: xr.DataArray,
    *,
    stem_m: tuple[float, float] | None = None,
    sensors: pd.DataFrame | None = None,
    sun: pd.DataFrame | None = None,
    columns: int = 2,
) -> Figure:
    """One map per time, one colour scale for all.

    Parameters
    ----------
    par : DataArray
        PAR on the ground, dims `time` (UTC), `y`, `x` (cell centres, local frame, m)
        [µmol m⁻² s⁻¹].
    stem_m : (float, float), optional
        East and north of the stem [m].
    sensors : DataFrame, optional
        `x_m`, `y_m` [m].
    sun : DataFrame, optional
        One row per time: `sun_zenith_deg`, `sun_azimuth_deg` [deg]; marks where the sun
        stands.
    columns : int
        Maps side by side.
    """
    par = par.transpose("time", "y", "x")
    columns = min(columns, par.sizes["time"])
    rows = -(-par.sizes["time"] // columns)
    extent = _extent(par)
    aspect = (extent[3] - extent[2]) / (extent[1] - extent[0])
    figure = style.new_figure(3.1 * columns + 1.2, (3.1 * aspect + 0.35) * rows + 0.9)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    top = float(par.max())
    for index, axes in enumerate(panels):
        if index >= par.sizes["time"]:
            axes.set_visible(False)
            continue
        image = axes.imshow(
            par[index],
            extent=extent,
            origin="lower",
            cmap=style.LIGHT_MAP,
            vmin=0,
            vmax=top if top > 0 else 1,
            interpolation="nearest",
        )
        _marks(axes, stem_m, sensors)
        when = pd.Timestamp(par["time"].to_numpy()[index])
        title = f"{when:%H:%M} UTC"
        if sun is not None:
            zenith, azimuth = sun[["sun_zenith_deg", "sun_azimuth_deg"]].iloc[index]
            title += f"   sun {90 - zenith:.0f}° high"
            _sun_mark(axes, azimuth)
        axes.set_title(title)
        axes.grid(False)
    for axes in panels[::columns]:
        axes.set_ylabel("north [m]")
    for axes in panels[max(par.sizes["time"] - columns, 0) : par.sizes["time"]]:
        axes.set_xlabel("east [m]")
        axes.tick_params(labelbottom=True)
    bar = figure.colorbar(image, ax=list(panels), shrink=0.75, pad=0.02)
    bar.set_label(f"PAR on the ground [{style.PAR_UNIT}]")
    bar.outline.set_visible(False)
    handles, labels = panels[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _extent(par: xr.DataArray) -> tuple[float, float, float, float]:
    """Outer edges of the cells whose centres are given [m]."""
    edges = []
    for axis in ("x", "y"):
        centres = par[axis].to_numpy().astype(float)
        half = 0.5 * (centres[1] - centres[0]) if len(centres) > 1 else 0.5
        edges += [centres[0] - half, centres[-1] + half]
    return tuple(edges)


def _marks(axes: Axes, stem_m, sensors: pd.DataFrame | None) -> None:
    if sensors is not None:
        x, y = sensors["x_m"], sensors["y_m"]
        axes.scatter(x, y, s=7, color=style.SENSOR, edgecolors="white", lw=0.4, label="sensor")
    if stem_m is not None:
        axes.scatter(*stem_m, s=34, facecolors="white", edgecolors=style.WOOD, lw=1.6, label="stem")


def _sun_mark(axes: Axes, azimuth_deg: float) -> None:
    """A small sun at the edge of the map, where the sun stands (azimuth clockwise from north)."""
    ray = np.array([np.sin(np.radians(azimuth_deg)), np.cos(np.radians(azimuth_deg))])
    corners = np.array([axes.get_xlim(), axes.get_ylim()])
    centre, half = corners.mean(axis=1), 0.5 * np.ptp(corners, axis=1)
    place = centre + ray * np.min(0.955 * half / np.maximum(np.abs(ray), 1e-9))
    look = {"facecolors": "#FF9D00", "edgecolors": "#222222", "linewidths": 0.8, "zorder": 5}
    axes.scatter(*place, s=75, marker=(12, 1, 0), label="direction of the sun", **look)
