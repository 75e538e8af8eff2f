"""The tree to be turned: leaves and wood of every reconstruction, voxels, sensors, neighbours."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple.figures import style
from dapple.formats import meshes, netcdf, tables
from dapple.formats.meshes import Mesh
from dapple.report import packing
from dapple.report.blocks import Block, Chart

LEAF_TRIANGLES, WOOD_TRIANGLES, NEIGHBOUR_TRIANGLES = 40_000, 20_000, 20_000
VOXELS = 8_000
"""Most of a kind in the page: of more, a sample is drawn."""


def blocks(folder: Path, names: list[str], first: str) -> Iterator[Block]:
    """A chart of all reconstructions of a folder, one shown at a time."""
    found = (_of_one(folder / f"structure/{name}", name) for name in names)
    shown = [one for one in found if one is not None]
    if not shown:
        return
    wood = _wood(folder, names)
    neighbours = folder / "tree/neighbours.ply"
    sensors = folder / "sky/sensors.csv"
    data = {
        "box_m": _box(shown, wood),
        "shown": shown,
        "first": next((k for k, one in enumerate(shown) if one["name"] == first), 0),
        "wood": wood,
        "neighbours": _sample(meshes.read_ply(neighbours), NEIGHBOUR_TRIANGLES)
        if neighbours.is_file()
        else None,
        "sensors": _sensors(tables.read(sensors)) if sensors.is_file() else None,
        "colours": {"leaf": style.LEAF, "wood": style.WOOD, "sensor": style.SENSOR},
    }
    yield Chart("tree", "tree", _caption(shown), data)


def _caption(shown: list[dict[str, Any]]) -> str:
    parts = [
        f"{one['label']}: {one['n_shown']:,} of {one['n']:,}".replace(",", "\u202f")
        for one in shown
        if one["n_shown"] < one["n"]
    ]
    text = (
        "The tree to turn: drag it, or press the buttons. Leaves are green, wood is brown, "
        "voxels are darker where they hold more plant area."
    )
    if parts:
        text += (
            f" To keep the page small a sample is shown ({'; '.join(parts)}), leaves enlarged so "
            "that their whole area stays the same."
        )
    return text


def _of_one(folder: Path, name: str) -> dict[str, Any] | None:
    facts: dict[str, Any] = {"name": name, "label": style.label(name)}
    if (grid := folder / "voxels.nc").is_file():
        return facts | _voxels(grid)
    if (leaves := folder / "leaves_0.ply").is_file():
        one = _sample(meshes.read_ply(leaves), LEAF_TRIANGLES, is_enlarged=True)
        return facts | {"leaves": one, "n": one["n"], "n_shown": one["n_shown"]}
    return None


def _box(shown: list[dict[str, Any]], wood: dict[str, Any]) -> list[list[float]]:
    """Lowest and highest corner of the tree [m], with half its width around it for its shadow."""
    packed = [one.get("centres") or one["leaves"]["corners"] for one in shown]
    packed += [one["corners"] for one in wood.values()]
    packed = [one for one in packed if one["shape"][0]]
    if not packed:
        return [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]
    low = np.min([one["low_m"] for one in packed], axis=0)
    high = np.max([one["high_m"] for one in packed], axis=0)
    around = 0.5 * (high - low).max() * np.array([1, 1, 0])
    return [(low - around).tolist(), (high + around).tolist()]


def _wood(folder: Path, names: list[str]) -> dict[str, Any]:
    """The wood of the truth for the truth, that of the polygons for all others."""
    found = {}
    for kind in ("polygons", "truth"):
        path = folder / f"structure/{kind}/wood.ply"
        if path.is_file() and (kind != "truth" or "truth" in names):
            found[kind] = _sample(meshes.read_ply(path), WOOD_TRIANGLES)
    return found


def _sample(mesh: Mesh, most: int, *, is_enlarged: bool = False) -> dict[str, Any]:
    """Whole elements (leaves, polygons, discs), evenly drawn, as corners of triangles.

    Those that are enlarged grow about their centres until their area is that of all.
    """
    numbers = np.unique(mesh.element)
    every = max(1, -(-len(mesh.faces) // most))
    kept = numbers[::every]
    is_kept = np.isin(mesh.element, kept)
    corners = mesh.vertices_m[mesh.faces[is_kept]]
    if is_enlarged and every > 1 and len(kept):
        area = np.linalg.norm(mesh.triangle_normal, axis=1)
        factor = np.sqrt(area.sum() / max(area[is_kept].sum(), 1e-12))
        place = np.searchsorted(kept, mesh.element[is_kept])
        middle = np.zeros((len(kept), 3))
        np.add.at(middle, place, corners.mean(axis=1))
        middle /= np.bincount(place, minlength=len(kept))[:, None]
        centre = middle[place][:, None]
        corners = centre + factor * (corners - centre)
    corners = packing.places(corners.reshape(-1, 3))
    return {"corners": corners, "n": len(numbers), "n_shown": len(kept)}


def _voxels(path: Path) -> dict[str, Any]:
    grid = netcdf.read(path)
    density = grid["plant_area_density_m2_m3"].transpose("x", "y", "z").to_numpy()
    filled = np.argwhere(np.nan_to_num(density) > 0)
    every = max(1, -(-len(filled) // VOXELS))
    kept = filled[::every]
    centres = np.column_stack([grid[axis].to_numpy()[kept[:, k]] for k, axis in enumerate("xyz")])
    values = density[tuple(kept.T)]
    return {
        "centres": packing.places(centres),
        "density": [round(float(value), 2) for value in values],
        "size_m": float(grid.attrs["voxel_size_m"]),
        "n": len(filled),
        "n_shown": len(kept),
    }


def _sensors(table: pd.DataFrame) -> dict[str, Any]:
    place = table[["x_m", "y_m", "z_m"]].round(3)
    return {"label": table["sensor"].astype(str).tolist()} | {
        axis: place[f"{axis}_m"].tolist() for axis in "xyz"
    }
