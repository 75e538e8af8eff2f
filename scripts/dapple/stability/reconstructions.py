"""What each method makes of a scan: scenes that light can meet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from dapple.errors import EmptyCloudError
from dapple.formats.meshes import Mesh
from dapple.scene.surfaces import Scene, of_kinds
from dapple.stability.stressors import Conditions
from dapple.streams import stream_seed
from dapple.structure import occlusion, subvoxel_clumping
from dapple.virtual.leaves import along_wood

if TYPE_CHECKING:
    from dapple.stability.chain import Chain


@dataclass(frozen=True)
class Structure:
    """What a method made of a scan.

    Attributes
    ----------
    scenes : tuple of Scene
        One, or several whose mean light counts.
    leaf_area_m2 : float
        One-sided.
    """

    scenes: tuple[Scene, ...]
    leaf_area_m2: float


def size_of(name: str) -> float:
    """Edge of the voxels of a reconstruction such as `voxels_0.2` [m]."""
    return float(name.split("_")[1])


def _truth(chain: Chain, conditions: Conditions) -> Structure:
    plant = chain.tree(conditions)
    scene = Scene(of_kinds(**plant), None, chain.setup.ground_z_m)
    return Structure((scene,), plant["leaf"].area_m2)


def _polygons(chain: Chain, conditions: Conditions) -> Structure:
    meshes = chain.polygons(conditions)
    return Structure((_scene(chain, meshes),), meshes["leaf"].area_m2)


def _voxels(name: str) -> Callable[[Chain, Conditions], Structure]:
    def make(chain: Chain, conditions: Conditions) -> Structure:
        grid = chain.voxels(conditions, size_of(name))
        wood = {"wood": chain.polygons(conditions)["wood"]}
        return Structure((_scene(chain, wood, grid),), voxel_area_m2(grid))

    return make


def _virtual_leaves(chain: Chain, conditions: Conditions) -> Structure:
    """Leaves by chance along the wood that was found; their area is known from elsewhere."""
    wood = chain.polygons(conditions)["wood"]
    settings = dict(chain.setup.leaves)
    placements = settings.pop("placements")
    scenes = []
    for number in range(placements):
        leaves = along_wood(
            wood, **settings, seed=stream_seed(chain.seed, "virtual leaves", number)
        )
        scenes.append(_scene(chain, {"leaf": leaves, "wood": wood}))
    return Structure(tuple(scenes), settings["leaf_area_m2"])


def _polygons_corrected(chain: Chain, conditions: Conditions) -> Structure:
    """Polygons with leaves added where the laser covers little."""
    meshes = chain.polygons(conditions)
    leaves = occlusion.correct(
        meshes["leaf"],
        chain.voxels(conditions, 0.2),
        seed=stream_seed(chain.seed, "occlusion"),
    )
    return Structure((_scene(chain, meshes | {"leaf": leaves}),), leaves.area_m2)


def _voxels_corrected(name: str) -> Callable[[Chain, Conditions], Structure]:
    def make(chain: Chain, conditions: Conditions) -> Structure:
        size_m = size_of(name)
        grid = chain.voxels(conditions, size_m)
        finer = chain.voxels(conditions, 0.2) if size_m > 0.2 else None
        effective = subvoxel_clumping.correct(
            grid, finer, chain.shots(conditions), kinds=chain.kinds(conditions)
        )
        wood = {"wood": chain.polygons(conditions)["wood"]}
        # What is corrected is how light passes; leaf area stays what was estimated.
        return Structure((_scene(chain, wood, effective),), voxel_area_m2(grid))

    return make


METHODS: dict[str, Callable[[Chain, Conditions], Structure]] = {
    "truth": _truth,
    "polygons": _polygons,
    "voxels_0.2": _voxels("voxels_0.2"),
    "voxels_1.0": _voxels("voxels_1.0"),
    "virtual_leaves": _virtual_leaves,
    "polygons_corrected": _polygons_corrected,
    "voxels_0.2_corrected": _voxels_corrected("voxels_0.2_corrected"),
    "voxels_1.0_corrected": _voxels_corrected("voxels_1.0_corrected"),
}


def _scene(chain: Chain, meshes: dict[str, Mesh], voxels: xr.Dataset | None = None) -> Scene:
    scene = Scene(of_kinds(**meshes), voxels, chain.setup.ground_z_m)
    if not scene.filled and (voxels is None or not (voxels["plant_area_density_m2_m3"] > 0).any()):
        raise EmptyCloudError("scene", "no leaf and no wood", "some", "Check the classes.")
    return scene


def voxel_area_m2(grid: xr.Dataset) -> float:
    """Leaf area of the voxels whose density is known [m²]."""
    density = grid["plant_area_density_m2_m3"].to_numpy()
    return float(np.nansum(density, dtype=np.float64) * grid.attrs["voxel_size_m"] ** 3)
