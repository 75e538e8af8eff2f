"""What each reconstruction makes of a scan: scenes that light can meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import xarray as xr

from dapple import steps
from dapple.formats.meshes import Mesh
from dapple.scene.surfaces import Scene
from dapple.stability.stressors import Conditions
from dapple.streams import stream_seed
from dapple.structure import occlusion, subvoxel_clumping
from dapple.structure.summary import voxel_area_m2
from dapple.structure.voxel_sizes import finer_than, size_of
from dapple.virtual.leaves import along_wood

if TYPE_CHECKING:
    from dapple.stability.chain import Chain


@dataclass(frozen=True)
class Structure:
    """What was made of a scan.

    Attributes
    ----------
    scenes : tuple of Scene
        One, or several whose mean light counts.
    leaf_area_m2 : float
        One-sided.
    """

    scenes: tuple[Scene, ...]
    leaf_area_m2: float


def make(chain: Chain, name: str, conditions: Conditions) -> Structure:
    """A reconstruction by its name (`reconstructions.names`), or the truth.

    Raises
    ------
    InputError
        What it needs cannot be made of this scan.
    """
    match name.split("_"):
        case ["truth"]:
            plant = chain.tree(conditions)
            return _one(chain, plant, plant["leaf"].area_m2)
        case ["polygons", *corrected]:
            return _polygons(chain, conditions, bool(corrected))
        case ["surfels"]:
            meshes = {
                "leaf": chain.surfels(conditions)[0],
                "wood": chain.polygons(conditions)["wood"],
            }
            return _one(chain, meshes, meshes["leaf"].area_m2)
        case ["voxels", _, *corrected]:
            return _voxels(chain, size_of(name), conditions, bool(corrected))
        case ["virtual", "leaves"]:
            return _virtual_leaves(chain, conditions)
    raise ValueError(name)


def _polygons(chain: Chain, conditions: Conditions, corrected: bool) -> Structure:
    """Polygons; corrected: with leaves added where the laser covers little."""
    meshes = chain.polygons(conditions)
    if corrected:
        leaves = occlusion.correct(
            meshes["leaf"],
            chain.voxels(conditions, min(chain.setup.sizes_m)),
            fill_range_m=chain.setup.fill_range_m,
            seed=stream_seed(chain.seed, "occlusion"),
        )
        meshes = meshes | {"leaf": leaves}
    return _one(chain, meshes, meshes["leaf"].area_m2)


def _voxels(chain: Chain, size_m: float, conditions: Conditions, corrected: bool) -> Structure:
    """Turbid voxels around the wood; corrected: with the density that light meets."""
    density = grid = chain.voxels(conditions, size_m)
    if corrected:
        finer_m = finer_than(size_m, chain.setup.sizes_m)
        density = subvoxel_clumping.correct(
            grid,
            chain.voxels(conditions, finer_m) if finer_m else None,
            chain.shots(conditions),
            kinds=chain.return_kinds(conditions),
            fill_range_m=chain.setup.fill_range_m,
        )
    wood = {"wood": chain.polygons(conditions)["wood"]}
    # What is corrected is how light passes; leaf area stays what was estimated.
    return _one(chain, wood, voxel_area_m2(grid), density)


def _virtual_leaves(chain: Chain, conditions: Conditions) -> Structure:
    """Leaves by chance along the wood that was found; their area is known from elsewhere."""
    wood = chain.polygons(conditions)["wood"]
    settings = dict(chain.setup.leaves)
    placements = settings.pop("placements")
    seeds = (stream_seed(chain.seed, "virtual leaves", k) for k in range(placements))
    scenes = (
        _scene(chain, {"leaf": along_wood(wood, **settings, seed=seed), "wood": wood})
        for seed in seeds
    )
    return Structure(tuple(scenes), settings["leaf_area_m2"])


def _one(
    chain: Chain, meshes: dict[str, Mesh], leaf_area_m2: float, voxels: xr.Dataset | None = None
) -> Structure:
    return Structure((_scene(chain, meshes, voxels),), leaf_area_m2)


def _scene(chain: Chain, meshes: dict[str, Mesh], voxels: xr.Dataset | None = None) -> Scene:
    return steps.scene(meshes, voxels, ground_z_m=chain.setup.ground_z_m)
