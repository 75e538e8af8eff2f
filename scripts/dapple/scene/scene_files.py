"""Scenes from the files of a reconstruction."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from dapple.formats import ground_surface, meshes, tables, voxel_grids
from dapple.formats.ground_surface import GroundSurface
from dapple.scene import sensors
from dapple.scene.surfaces import GROUND, LEAF, Scene, Surface, of_kinds

MOST_NODES = 120
"""Of terrain along an edge: light under a tree does not tell finer ground apart."""


@dataclass(frozen=True)
class Around:
    """What stands around a tree.

    Attributes
    ----------
    ground : GroundSurface
    surfaces : tuple of Surface
        Terrain where the ground is not flat, and neighbours, which are taken for leaves.
    ground_z_m : float
        Height of the flat ground below it all [m].
    """

    ground: GroundSurface
    surfaces: tuple[Surface, ...]
    ground_z_m: float


LEVEL = Around(ground_surface.flat(0.0), (), 0.0)


def around(ground: str | float, shade: str = "") -> Around:
    """What stands around a tree.

    Parameters
    ----------
    ground : path or float
        Surface of the ground, or the height of flat ground [m].
    shade : path
        PLY mesh of neighbours; empty: the tree stands alone.
    """
    found = ground_surface.read(ground) if isinstance(ground, str) else ground_surface.flat(ground)
    surfaces, lowest_m = [], found.lowest_m
    if not found.is_flat:
        terrain = found.mesh(MOST_NODES)
        lowest_m = float(terrain.vertices_m[:, 2].min())
        surfaces.append(Surface(terrain, GROUND, is_leaf=False))
    if shade:
        surfaces.append(Surface(meshes.read_ply(shade), LEAF))
    return Around(found, tuple(surfaces), lowest_m)


def read(leaves: Sequence[str], wood: str, beside: Around = LEVEL) -> list[Scene]:
    """Put together what light meets, once for every placement of the leaves.

    Parameters
    ----------
    leaves : sequence of path
        PLY meshes, one a placement, or a NetCDF voxel grid.
    wood : path
        PLY mesh.
    beside : Around
        Ground and neighbours.
    """
    branches = meshes.read_ply(wood)
    scenes = []
    for path in map(Path, leaves):
        if path.suffix == ".nc":
            surfaces, voxels = of_kinds(wood=branches), voxel_grids.read(path)
        else:
            surfaces, voxels = of_kinds(leaf=meshes.read_ply(path), wood=branches), None
        scenes.append(Scene((*surfaces, *beside.surfaces), voxels, beside.ground_z_m))
    return scenes


def with_sensors(inputs: Any, params: Any) -> tuple[list[Scene], pd.DataFrame]:
    """What light meets, and the table of its sensors, none of which may lie in it.

    Parameters
    ----------
    inputs, params
        Of a rule: `leaves`, `wood`, `sensors`, `ground`, `shade`; `ground_z_m`, where there is no
        surface of the ground, and `sensor_table`, the name of the user's table for messages.
    """
    beside = around(inputs.ground or params.ground_z_m, inputs.shade)
    scenes = read(inputs.leaves, inputs.wood, beside)
    table = tables.read(inputs.sensors)
    for scene in scenes:
        sensors.check(table, scene.filled, where=params.sensor_table)
    return scenes, table


def read_plot(leaves: str, wood: str, terrain: str) -> Scene:
    """Put together a plot: facets over terrain, and flat ground at its lowest point around it.

    Parameters
    ----------
    leaves, wood, terrain : path
        PLY meshes in one local frame.
    """
    kinds = {"leaf": leaves, "wood": wood, "ground": terrain}
    found = {kind: meshes.read_ply(path) for kind, path in kinds.items()}
    lowest = float(found["ground"].vertices_m[:, 2].min())
    return Scene(of_kinds(**found), ground_z_m=lowest)
