"""The stages of a run on data in memory, each written once.

Rules run one stage a script, from file to file; stability map, advice, trade-off and benchmarks run
the same functions one after the other. From points to light:

- `cloud.clean.clean`: points without noise, one a voxel
- `cloud.classify.classify`: leaf or wood
- `polygons`, `surfels`, `voxels`: what a scan is rebuilt as
- `rescan`: which shots of the scan it would end, and where
- `scene`: what light meets
- `sun`, `paths`, `products`: shadow rays to the sun's disc; paths back from the sensors, once for
  any sky and spectrum; both put together under a sky
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import EmptyCloudError
from dapple.formats import meshes as mesh_files
from dapple.formats.clouds import LEAF, WOOD, Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.netcdf import times
from dapple.formats.shots import Shots
from dapple.light import series, transport, visibility
from dapple.light.light_model import Model, Tracing, interpolated, simplified, thinned
from dapple.light.series import Light
from dapple.light.tensor import Transport
from dapple.light.visibility import Sunlit
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds
from dapple.scene.traced import TracedScene
from dapple.sky.open_sky import towards_sun
from dapple.structure import polygon_sizes
from dapple.structure import surfels as discs
from dapple.structure.polygons import reconstruct
from dapple.structure.returns import Kinds, kinds_by_place
from dapple.structure.voxel_sums import Grid
from dapple.structure.voxels import plant_area_density
from dapple.virtual import rescan as virtual_rescan
from dapple.virtual import rescan_scores


def polygons(cloud: Cloud, *, seed: int, **settings: Any) -> dict[str, Mesh]:
    """One planar polygon per voxel, separately for leaf and wood.

    Parameters
    ----------
    cloud : Cloud
        With `Classification`.
    seed : int
    **settings
        Of `structure.polygons.reconstruct`, `voxel_size_m` perhaps "auto", and `leaf_size_m`.

    Returns
    -------
    dict of str to Mesh
        `leaf` and `wood`; no wood where no point is wood.

    Raises
    ------
    EmptyCloudError
        No point is leaf.
    """
    return polygons_of(points_by_kind(cloud), seed=seed, **settings)


def points_by_kind(cloud: Cloud) -> dict[str, np.ndarray]:
    """Places (n, 3) of `leaf` and of `wood` [m]: beside them a large cloud need not be kept."""
    kinds = cloud.attributes["Classification"]
    return {"leaf": cloud.xyz_m[kinds == LEAF], "wood": cloud.xyz_m[kinds == WOOD]}


def polygons_of(points_m: dict[str, np.ndarray], *, seed: int, **settings: Any) -> dict[str, Mesh]:
    """`polygons` from what `points_by_kind` gives."""
    settings = polygon_sizes.resolved(points_m["leaf"], settings)
    leaf, wood_m = (
        reconstruct(points_m["leaf"], what="leaf", seed=seed, **settings),
        points_m["wood"],
    )
    wood = reconstruct(wood_m, what="wood", seed=seed, **settings) if len(wood_m) else None
    return {"leaf": leaf, "wood": wood or mesh_files.empty()}


def surfels(
    cloud: Cloud, shots: Shots | Iterable[Shots] | None, *, seed: int, **settings: Any
) -> tuple[Mesh, dict[str, Any]]:
    """Leaves as discs on the surfaces that leaf points lie on.

    Parameters
    ----------
    cloud : Cloud
        With `Classification`.
    shots : Shots, iterable of Shots or None
        The whole scan, misses included, where it is known.
    seed : int
    **settings
        Of `structure.surfels.reconstruct`.

    Returns
    -------
    leaves : Mesh
    facts : dict

    Raises
    ------
    EmptyCloudError
        No point is leaf.
    """
    shots = [shots] if isinstance(shots, Shots) else shots
    return discs.reconstruct(
        cloud.xyz_m[cloud.attributes["Classification"] == LEAF], shots, seed=seed, **settings
    )


def voxels(
    shots: Shots | Iterable[Shots], cloud: Cloud, size_m: float, *, kinds: Kinds, **settings: Any
) -> xr.Dataset:
    """Plant area density in voxels around the classified points.

    Parameters
    ----------
    shots : Shots or iterable of Shots
        The whole scan, misses included.
    cloud : Cloud
        Classified.
    size_m : float
        Edge of the voxels [m].
    kinds : callable
        What each return is, as `return_kinds` tells.
    **settings
        Of `structure.voxels.plant_area_density`.
    """
    bounds_m = np.array([cloud.xyz_m.min(axis=0), cloud.xyz_m.max(axis=0)])
    return plant_area_density(shots, Grid.around(bounds_m, size_m), kinds=kinds, **settings)


def return_kinds(cloud: Cloud, majority_voxel_m: float) -> Kinds:
    """What each return of a scan is, by the classified points around it.

    Parameters
    ----------
    cloud : Cloud
        Classified, filtered and thinned.
    majority_voxel_m : float
        Edge of the voxels in which the classification took the majority [m].
    """
    kinds = cloud.attributes["Classification"]
    return kinds_by_place(cloud.xyz_m, kinds, voxel_size_m=majority_voxel_m)


def rescan(
    meshes: dict[str, Mesh],
    voxels: xr.Dataset | None,
    shots: Iterable[Shots],
    cloud: Cloud,
    *,
    layers: int,
    tolerance_m: float,
    max_deviation: float,
    seed: int,
    **beam: Any,
) -> pd.DataFrame:
    """How many shots a reconstruction predicts, by part of the crown.

    Parameters
    ----------
    meshes : dict of str to Mesh
        `leaf` and `wood`, as far as there are such.
    voxels : xarray.Dataset or None
        Plant area density.
    shots : iterable of Shots
        To predict: best from a position that the reconstruction was made without.
    cloud : Cloud
        Classified, of the whole plant: its box, and how bright leaf and wood are.
    layers : int
        Height layers of the crown.
    tolerance_m : float
        A range this near to the measured one is right [m].
    max_deviation : float
        Returns at or above are mixed of several targets.
    seed : int
    **beam
        Fields of `scanner_model.Scanner`.
    """
    shots = list(shots)
    crown = virtual_rescan.crown_of(cloud)
    scanner = virtual_rescan.scanner_of(cloud, shots, **beam)
    found = virtual_rescan.first_ranges(meshes, voxels, shots, crown, scanner, seed=seed)
    rows = rescan_scores.compared(found, crown, max_deviation)
    return rescan_scores.by_part(rows, layers, tolerance_m)


def scene(
    meshes: dict[str, Mesh], voxels: xr.Dataset | None = None, *, ground_z_m: float = 0.0
) -> Scene:
    """What light meets: leaves and wood, turbid voxels, flat ground.

    Parameters
    ----------
    meshes : dict of str to Mesh
        `leaf` and `wood`, as far as there are such.
    voxels : xarray.Dataset or None
        Plant area density.
    ground_z_m : float
        Height of the ground [m].

    Raises
    ------
    EmptyCloudError
        Nothing at all.
    """
    found = Scene(of_kinds(**meshes), voxels, ground_z_m)
    if not found.filled and (voxels is None or not (voxels["plant_area_density_m2_m3"] > 0).any()):
        raise EmptyCloudError("scene", "no leaf and no wood", "some", "Check the classes.")
    return found


def sun(
    scene: TracedScene,
    sensors_m: np.ndarray,
    sky: xr.Dataset,
    model: Model,
    tracing: Tracing,
    *,
    facing: np.ndarray | None = None,
    keys: np.ndarray | None = None,
    seed: int,
) -> Sunlit:
    """What sensors see of the sun at the times of a sky, traced as often as a model wants.

    Parameters
    ----------
    scene : TracedScene
    sensors_m : (n, 3) float64
        Local frame [m].
    sky : xarray.Dataset
        For its times and suns.
    model : Model
        Sun and time step count.
    tracing : Tracing
    facing : (n, 3) float64 or None
        Unit normals of the sensors; None: they are level.
    keys : (n,) uint32 or None
        Which random numbers each sensor draws; None: those of its place in the list.
    seed : int
    """
    minutes = (times(sky) - times(sky)[0]).total_seconds().to_numpy() / 60
    chosen = thinned(minutes, model.step_min)
    seen = visibility.sunlit(
        scene,
        sensors_m,
        towards_sun(sky)[chosen],
        tolerance=tracing.sun_tolerance,
        max_rays=tracing.max_shadow_rays,
        sun_diameter_deg=0.0 if model.sun == "point" else tracing.sun_diameter_deg,
        aperture_m=tracing.aperture_m,
        facing=facing,
        keys=keys,
        seed=seed,
    )
    return interpolated(seen, minutes[chosen], minutes) if len(chosen) < len(minutes) else seen


def paths(
    scene: TracedScene,
    sensors_m: np.ndarray,
    model: Model,
    tracing: Tracing,
    *,
    optics: Optics | None = None,
    facing: np.ndarray | None = None,
    keys: np.ndarray | None = None,
    seed: int,
) -> Transport:
    """Rays to the sky and paths back from the sensors, counted for any sky, spectrum and time.

    Parameters
    ----------
    scene : TracedScene
    sensors_m : (n, 3) float64
        Local frame [m].
    model : Model
        Sky patches and orders count.
    tracing : Tracing
    optics : Optics or None
        Nominal spectra by which errors are judged; where they are given and `tracing` allows it,
        rays are added until errors are small.
    facing : (n, 3) float64 or None
        Unit normals of the sensors; None: they are level.
    keys : (n,) uint32 or None
        Which random numbers each sensor draws; None: those of its place in the list.
    seed : int
    """
    growth = None
    if optics is not None and tracing.max_growth > 1:
        growth = transport.Growth(
            tracing.path_tolerance, tracing.max_growth, optics, tracing.sun_kernel_deg
        )
    return transport.collect(
        scene,
        sensors_m,
        n_paths=tracing.paths,
        n_sky_rays=tracing.sky_rays,
        n_patches=model.sky_patches,
        max_orders=model.max_orders,
        growth=growth,
        aperture_m=tracing.aperture_m,
        response=tracing.response,
        facing=facing,
        keys=keys,
        seed=seed,
    )


def products(
    sunlit: Sunlit,
    counted: Transport,
    sky: xr.Dataset,
    optics: Optics,
    model: Model,
    tracing: Tracing,
    facing: np.ndarray | None = None,
) -> Light:
    """Light under a sky from what was traced of the sun and of paths.

    Parameters
    ----------
    sunlit : Sunlit
        At the times of the sky.
    counted : Transport
        Paths of the same sensors.
    sky : xarray.Dataset
        Sun and sky in b bands.
    optics : Optics
        In the same bands.
    model : Model
        Sky, ground and bands count.
    tracing : Tracing
        For the kernel of the sun.
    facing : (n, 3) float64 or None
        As in `paths`.
    """
    kept = simplified(sky, optics, model)
    return series.compute(
        sunlit, counted, *kept, sun_kernel_deg=tracing.sun_kernel_deg, facing=facing
    )
