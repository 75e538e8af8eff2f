"""Reconstructions of several sizes, read when they are needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dapple.formats import voxel_grids
from dapple.scene import scene_files
from dapple.scene.scene_files import Around
from dapple.scene.surfaces import WOOD, Scene


@dataclass(frozen=True)
class Geometry:
    """A reconstruction of one size.

    Attributes
    ----------
    kind : {"polygons", "surfels", "voxels"}
    size_m : float
        Edge of the voxels that polygons were made in, or of the turbid voxels; distance of the
        points that carry surfels [m].
    load : callable
        Reads the scene.
    """

    kind: str
    size_m: float
    load: Callable[[], Scene]


def polygons(
    sizes_m: Sequence[float], leaves: Sequence[str], wood: Sequence[str], around: Around
) -> list[Geometry]:
    """Polygons of all sizes of which there are files."""

    def load(one: str, branches: str) -> Callable[[], Scene]:
        return lambda: scene_files.read([one], branches, around)[0]

    files = zip(sizes_m, leaves, wood, strict=False)
    return [Geometry("polygons", size_m, load(*paths)) for size_m, *paths in files]


def surfels(spacing_m: float, leaves: Sequence[str], wood: str, around: Around) -> list[Geometry]:
    """Surfels, where the run makes them."""

    def load(path: str) -> Callable[[], Scene]:
        return lambda: scene_files.read([path], wood, around)[0]

    return [Geometry("surfels", spacing_m, load(path)) for path in leaves]


def voxels(
    sizes_m: Sequence[float], grids: Sequence[str], base: Scene, around: Around
) -> list[Geometry]:
    """Turbid voxels of all sizes of which there are files, around the wood of a scene."""
    surfaces = (*base.of(WOOD), *around.surfaces)

    def load(path: str) -> Callable[[], Scene]:
        return lambda: Scene(surfaces, voxel_grids.read(path), base.ground_z_m)

    files = zip(sizes_m, grids, strict=False)
    return [Geometry("voxels", size_m, load(path)) for size_m, path in files]
