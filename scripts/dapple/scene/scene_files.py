"""Scenes from the files of a reconstruction."""

from collections.abc import Sequence
from pathlib import Path

from dapple.formats import meshes, voxel_grids
from dapple.scene.surfaces import Scene, of_kinds


def read(leaves: Sequence[str], wood: str, ground_z_m: float = 0.0) -> list[Scene]:
    """Put together what light meets, once for every placement of the leaves.

    Parameters
    ----------
    leaves : sequence of path
        PLY meshes, one a placement, or a NetCDF voxel grid.
    wood : path
        PLY mesh.
    ground_z_m : float
        Height of the ground [m].
    """
    branches = meshes.read_ply(wood)
    scenes = []
    for path in map(Path, leaves):
        if path.suffix == ".nc":
            scenes.append(Scene(of_kinds(wood=branches), voxel_grids.read(path), ground_z_m))
        else:
            surfaces = of_kinds(leaf=meshes.read_ply(path), wood=branches)
            scenes.append(Scene(surfaces, None, ground_z_m))
    return scenes


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
