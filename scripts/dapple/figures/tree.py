"""The reconstructed tree from the side and from above, with sensors and scan positions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from dapple.figures import painter, style
from dapple.formats import ground_surface, tables
from dapple.formats.meshes import Mesh
from dapple.scene import scene_files
from dapple.scene.surfaces import Scene, Surface

PANEL_IN = 4.0  # width of one view
HAZE = 0.35
UNKNOWN = "#E9E9EE"


@dataclass(frozen=True)
class View:
    """Which axes of the local frame lie along the page, and how the third recedes."""

    title: str
    across: int
    up: int
    depth: int
    nearer: float  # +1 where a larger depth coordinate is nearer to the eye
    labels: tuple[str, str]


SIDE = View("from the south", 0, 2, 1, -1.0, ("east [m]", "up [m]"))
ABOVE = View("from above", 0, 1, 2, 1.0, ("east [m]", "north [m]"))


def of_run(inputs: Mapping[str, Any], options: Mapping[str, Any]) -> Figure:
    """From the files of a run: `leaves`, `wood`, `sensors`, and `ground` where it is not flat.

    Options are `ground_z_m` of flat ground.
    """
    scene = scene_files.read([inputs["leaves"]], inputs["wood"])[0]
    ground_z_m = options["ground_z_m"]
    if inputs["ground"]:
        middle_m = scene.bounds_m.mean(axis=0)[None, :2]
        ground_z_m = float(ground_surface.read(inputs["ground"]).height_m(middle_m)[0])
    scene = replace(scene, ground_z_m=ground_z_m)
    return draw(scene, sensors=tables.read(inputs["sensors"]))


@style.styled
def draw(
    scene: Scene,
    *,
    sensors: pd.DataFrame | None = None,
    scan_positions_m: np.ndarray | None = None,
    title: str = "",
    margin_m: float = 0.4,
) -> Figure:
    """Two views at one scale.

    Parameters
    ----------
    scene : Scene
        Meshes are drawn as shaded triangles, near ones in front; voxels as squares, coloured by the
        plant area along the line of sight.
    sensors : DataFrame, optional
        `x_m`, `y_m`, `z_m` [m].
    scan_positions_m : (k, 3) array, optional
        Scanner positions [m]; those beyond the frame are marked at its edge.
    title : str
        Name of the reconstruction.
    margin_m : float
        Space around tree and sensors [m].
    """
    low, high = _bounds(scene, sensors)
    low, high = low - margin_m, high + margin_m
    height_m, bottom_m = high[2] - low[2], low[2] + margin_m
    # Ground that lies farther below than the plants are high is not theirs.
    is_grounded = bottom_m - scene.ground_z_m < height_m
    low[2] = (min(scene.ground_z_m, bottom_m) if is_grounded else bottom_m) - 0.15
    figure, panels, bar_axes = _panels(high - low, scene.voxels is not None)
    norm = _density_norm(scene.voxels)
    for axes, view in zip(panels, (SIDE, ABOVE), strict=True):
        axes.set(
            xlim=(low[view.across], high[view.across]),
            ylim=(low[view.up], high[view.up]),
            xlabel=view.labels[0],
            ylabel=view.labels[1],
        )
        axes.set_title(f"{title}, {view.title}" if title else view.title)
        axes.set_axisbelow(True)
        _mesh_layer(axes, scene.surfaces, view, low, high)
        if scene.voxels is not None:
            squares = _voxel_layer(axes, scene.voxels, view, norm)
        _points(axes, view, sensors, scan_positions_m, low, high)
    if is_grounded:
        panels[0].axhline(scene.ground_z_m, color="#A89F91", linewidth=1.0, zorder=1)
    if scene.voxels is not None:
        bar = figure.colorbar(squares, cax=bar_axes)
        bar.set_label("plant area along the line of sight [m² m⁻²]")
        bar.outline.set_visible(False)
    entries = dict(
        pair[::-1]
        for axes in panels
        for pair in zip(*axes.get_legend_handles_labels(), strict=True)
    )
    if entries:
        figure.legend(entries.values(), entries, loc="lower center", ncols=len(entries))
    return figure


def _panels(extent_m: np.ndarray, with_bar: bool) -> tuple[Figure, list[Axes], Axes | None]:
    """Two axes at exactly one scale that stand on one line, and one for a colour bar."""
    width, heights = PANEL_IN, PANEL_IN * extent_m[[2, 1]] / extent_m[0]
    left, gap, bottom, top = 0.6, 0.65, 0.85, 0.35
    size = np.array([left + 2 * width + gap + (1.0 if with_bar else 0.15), bottom + top])
    size[1] += max(heights)
    figure = Figure(figsize=size, dpi=style.DPI)
    places = [(left, heights[0]), (left + width + gap, heights[1])]
    panels = [
        figure.add_axes((x / size[0], bottom / size[1], width / size[0], height / size[1]))
        for x, height in places
    ]
    if not with_bar:
        return figure, panels, None
    x, height = left + 2 * width + gap + 0.15, 0.8 * max(heights)
    return (
        figure,
        panels,
        figure.add_axes((x / size[0], bottom / size[1], 0.13 / size[0], height / size[1])),
    )


def _bounds(scene: Scene, sensors: pd.DataFrame | None) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box around meshes, known leaf voxels and sensors."""
    boxes = [surface.mesh.vertices_m for surface in scene.filled]
    if scene.voxels is not None:
        filled = _density(scene.voxels)
        half = 0.5 * scene.voxels.attrs["voxel_size_m"]
        places = np.argwhere(np.nan_to_num(filled) > 0)
        centres = np.column_stack(
            [scene.voxels[axis].to_numpy()[places[:, k]] for k, axis in enumerate("xyz")]
        )
        boxes += [centres - half, centres + half]
    if sensors is not None:
        boxes.append(sensors[["x_m", "y_m", "z_m"]].to_numpy(float))
    boxes = [box for box in boxes if len(box)]
    if not boxes:
        return np.full(3, -1.0), np.full(3, 1.0)
    points = np.concatenate(boxes)
    return points.min(axis=0), points.max(axis=0)


def _mesh_layer(axes: Axes, surfaces: Sequence[Surface], view: View, low, high) -> None:
    """All triangles of all kinds in one picture, so that near leaves hide far branches."""
    page = [view.across, view.up]
    corners, colours = [np.empty((0, 3, 3))], [np.empty((0, 3))]
    for surface in surfaces:
        mesh = surface.mesh
        triangles = mesh.vertices_m[mesh.faces][:, :, [*page, view.depth]]
        triangles[:, :, 2] *= view.nearer
        rgb = _shaded(mesh, to_rgb(style.LEAF if surface.is_leaf else style.WOOD), view)
        # Far parts fade towards white, which tells front from back without a third axis.
        limits = np.sort(view.nearer * np.array([low[view.depth], high[view.depth]]))
        nearness = (triangles[:, :, 2].mean(axis=1) - limits[0]) / np.ptp(limits)
        haze = HAZE * (1 - np.clip(nearness, 0, 1))[:, None]
        corners.append(triangles)
        colours.append(rgb * (1 - haze) + haze)
    image = painter.render(
        np.concatenate(corners),
        np.concatenate(colours),
        low[page],
        high[page],
        width_px=round(PANEL_IN * style.DPI),
    )
    extent = (*axes.get_xlim(), *axes.get_ylim())
    axes.imshow(
        image, extent=extent, origin="lower", interpolation="nearest", aspect="auto", zorder=2
    )


def _shaded(mesh: Mesh, rgb: tuple[float, float, float], view: View) -> np.ndarray:
    """(t, 3) colours: bright where a triangle faces the lamp, both sides alike."""
    lamp = np.zeros(3)
    lamp[[view.across, view.up, view.depth]] = [-0.45, 0.55, 0.70 * view.nearer]
    length = np.linalg.norm(mesh.triangle_normal, axis=1)
    normal = mesh.triangle_normal / np.where(length > 0, length, 1.0)[:, None]
    # Each element has its own tone, so that one leaf stands out from the next.
    tone = 0.9 + 0.2 * ((mesh.element * 0.6180339887) % 1.0)
    bright = tone * (0.55 + 0.5 * np.abs(normal @ (lamp / np.linalg.norm(lamp))))
    return np.clip(np.asarray(rgb) * bright[:, None], 0, 1)


def _density(voxels: xr.Dataset) -> np.ndarray:
    return voxels["plant_area_density_m2_m3"].transpose("x", "y", "z").to_numpy()


def _columns(voxels: xr.Dataset, depth_axis: int) -> np.ndarray:
    """Plant area per cross section along the line of sight [m² m⁻²]; unknown voxels add nothing."""
    return np.nansum(_density(voxels), axis=depth_axis) * voxels.attrs["voxel_size_m"]


def _density_norm(voxels: xr.Dataset | None) -> Normalize | None:
    if voxels is None:
        return None
    top = max(_columns(voxels, view.depth).max() for view in (SIDE, ABOVE))
    return Normalize(0, top if top > 0 else 1.0)


def _voxel_layer(axes: Axes, voxels: xr.Dataset, view: View, norm: Normalize | None):
    area = _columns(voxels, view.depth)
    unknown = np.isnan(_density(voxels)).any(axis=view.depth) & (area == 0)
    half = 0.5 * voxels.attrs["voxel_size_m"]
    edges = [
        np.append(values - half, values[-1] + half)
        for values in (voxels["xyz"[k]].to_numpy() for k in (view.across, view.up))
    ]
    if unknown.any():
        grey = np.ma.masked_where(~unknown, np.ones(area.shape)).T
        axes.pcolormesh(*edges, grey, cmap=ListedColormap([UNKNOWN]), zorder=1)
        axes.add_patch(Rectangle((0, 0), 0, 0, color=UNKNOWN, label="unknown: too few shots"))
    squares = np.ma.masked_where(area == 0, area).T
    return axes.pcolormesh(*edges, squares, cmap=style.DENSITY_MAP, norm=norm, alpha=0.8, zorder=3)


def _points(axes: Axes, view: View, sensors, scan_positions_m, low, high) -> None:
    if sensors is not None:
        x, y = (sensors[["x_m", "y_m", "z_m"][k]] for k in (view.across, view.up))
        axes.scatter(
            x, y, s=13, color=style.SENSOR, edgecolors="white", linewidths=0.5, zorder=5,
            label="sensor",
        )  # fmt: skip
    if scan_positions_m is not None and len(scan_positions_m):
        _scanners(axes, view, np.asarray(scan_positions_m, float), low, high)


def _scanners(axes: Axes, view: View, positions_m: np.ndarray, low, high) -> None:
    """Squares where scanners stand; from above, a wedge at the edge towards those beyond it."""
    across_up = [view.across, view.up]
    inside = np.all((positions_m > low)[:, :2] & (positions_m < high)[:, :2], axis=1)
    colour = {"color": style.SCANNER, "edgecolors": "white", "linewidths": 0.5, "zorder": 6}
    if inside.any():
        places = positions_m[inside][:, across_up].T
        axes.scatter(*places, s=30, marker="s", label="scan position", **colour)
    if inside.all() or view is SIDE:
        return
    centre, half = 0.5 * (low + high)[across_up], 0.5 * (high - low)[across_up]
    rays = positions_m[~inside][:, across_up] - centre
    reach = np.linalg.norm(rays, axis=1)
    far = f"{reach.min():.0f} to {reach.max():.0f} m" if np.ptp(reach) > 1 else f"{reach[0]:.0f} m"
    label: str | None = f"towards a scan position ({far} from the centre)"
    for ray in rays:
        edge = centre + ray * np.min(0.965 * half / np.maximum(np.abs(ray), 1e-9))
        angle = np.degrees(np.arctan2(ray[1], ray[0])) - 90
        axes.scatter(*edge, s=55, marker=(3, 0, angle), label=label, **colour)
        label = None
