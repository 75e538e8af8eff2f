"""Build Mitsuba's scene from ours: leaves, wood, turbid voxels, ground, a sky map and a sun.

Mitsuba's three colour channels serve as three spectral bands. Everything stays in the local
frame (x east, y north, z up); only the sky map has axes of its own, turned here.
"""

from types import ModuleType
from typing import Any

import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.scene.mitsuba_plugins import register
from dapple.scene.render_scene import RenderScene, facing, grey, leaf_shares
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, TurbidGrid, turbid_grid
from dapple.scene.traced import instances

SPHERICAL_G = 0.5
"""Projection of a unit of leaf area with spherical angles, in any direction (Ross 1981)."""


def build(
    scene: Scene,
    optics: Optics,
    *,
    variant: str = "llvm_ad_rgb",
    sky_step_deg: float = 1.0,
    ground_radius_m: float = 1000.0,
) -> RenderScene:
    """Build the Mitsuba scene once; sun and sky are dark until they are set.

    Parameters
    ----------
    scene : Scene
    optics : Optics
        One to three bands (`group_bands` gathers more).
    variant : str
        An rgb variant of Mitsuba.
    sky_step_deg : float
        Resolution of the sky map; divides 90.
    ground_radius_m : float
        The ground is a disc of this radius below the scene's centre.

    Raises
    ------
    InputError
        More than three bands, a surface without optics, or leaf angles that are not spherical.
    """
    if not 1 <= len(optics) <= 3:
        raise InputError(
            "bands", f"{len(optics)} bands", "1 to 3", "Gather them with scene.group_bands."
        )
    scene.check()
    mi = engine.load(variant)
    register()
    grid = turbid_grid(scene.voxels)
    if grid is not None and grid.leaf_angle_distribution != "spherical":
        raise InputError(
            "leaf_angle_distribution",
            grid.leaf_angle_distribution,
            "spherical, for which the extinction is the same in all directions (G = 0.5)",
            "For other leaf angles use the transport engine with light.check: false.",
        )
    rows = 2 * round(90.0 / sky_step_deg) + 1
    shape = (rows, 2 * (rows - 1))
    bsdfs = _bsdfs(mi, scene, optics)
    ground = mi.load_dict({"type": "diffuse", "reflectance": grey(optics, scene.ground_optics)})
    content = {
        "type": "scene",
        "sun": dark_sun(mi),
        "sky": sky_emitter(mi, shape),
        "ground": {
            "type": "disk",
            "to_world": _affine(mi, _below(scene), ground_radius_m),
            "bsdf": ground,
        },
        **_plants(mi, scene, bsdfs),
    }
    box = None
    if grid is not None:
        leaf = leaf_shares(optics, scene.voxel_optics)
        content["voxels"], box = _medium_box(mi, grid, *leaf, scene.ground_z_m)
    loaded = mi.load_dict(content)
    inside = [shape.interior_medium() for shape in loaded.shapes() if shape.id() == "voxels"]
    return RenderScene(
        mi=mi,
        scene=loaded,
        n_bands=len(optics),
        ground_z_m=scene.ground_z_m,
        variant=variant,
        sky_shape=shape,
        medium=inside[0] if inside else None,
        medium_box_m=box,
        bsdfs=[*bsdfs.items(), (scene.ground_optics, ground)],
    )


def _bsdfs(mi: ModuleType, scene: Scene, optics: Optics) -> dict[str, Any]:
    """What surfaces are made of, by name of optics; each serves all surfaces that share it."""
    found = {}
    for surface in scene.filled:
        name = surface.optics
        if surface.is_leaf:
            reflectance, transmittance = (mi.ScalarColor3f(x) for x in leaf_shares(optics, name))
            bsdf = {"reflectance": reflectance, "transmittance": transmittance}
            bsdf["type"] = "bilambertian"
        else:
            inner = {"type": "diffuse", "reflectance": grey(optics, name)}
            bsdf = {"type": "twosided", "bsdf": inner}
        if name not in found:
            found[name] = mi.load_dict(bsdf)
    return found


def _plants(mi: ModuleType, scene: Scene, bsdfs: dict[str, Any]) -> dict[str, Any]:
    """Meshes where they are, and groups of meshes in many places."""
    content: dict[str, Any] = {}
    for number, (places_m, surfaces) in enumerate(scene.plants):
        meshes = {
            f"{surface.optics}_{number}_{k}": triangles(
                mi, f"{surface.optics}_{number}_{k}", surface.mesh, bsdfs[surface.optics]
            )
            for k, surface in enumerate(surfaces)
        }
        if places_m is None:
            content |= meshes
        else:
            content |= instances(mi, f"plant_{number}", meshes, places_m)
    return content


def triangles(mi: ModuleType, name: str, mesh: Mesh, bsdf: Any) -> Any:
    """A Mitsuba mesh without shading normals, every triangle of one BSDF."""
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    properties["face_normals"] = True
    shape = mi.Mesh(name, len(mesh.vertices_m), len(mesh.faces), props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.asarray(mesh.vertices_m, dtype=np.float32).ravel()
    parameters["faces"] = np.asarray(mesh.faces, dtype=np.uint32).ravel()
    parameters.update()
    return shape


def _below(scene: Scene) -> np.ndarray:
    """The point of the ground below the middle of the plants."""
    if not scene.filled and turbid_grid(scene.voxels) is None:
        return np.array([0.0, 0.0, scene.ground_z_m])
    middle = scene.bounds_m.mean(axis=0)
    return np.array([middle[0], middle[1], scene.ground_z_m])


def _affine(mi: ModuleType, shift_m: np.ndarray, scale: float | np.ndarray) -> Any:
    scale = np.broadcast_to(np.asarray(scale, dtype=np.float64), 3).tolist()
    transform = mi.ScalarTransform4f()
    return transform.translate(np.asarray(shift_m).tolist()) @ transform.scale(scale)


def dark_sun(mi: ModuleType) -> dict:
    """Parallel light from the zenith, without light until it is set."""
    return {
        "type": "directional",
        "to_world": facing(mi, np.array([0.0, 0.0, -1.0])),
        "irradiance": {"type": "rgb", "value": [0.0, 0.0, 0.0]},
    }


def sky_emitter(mi: ModuleType, shape: tuple[int, int]) -> dict:
    """A sky map whose axes (x, y up, -z at azimuth 0) are turned to east, up, north."""
    turn = [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ones((*shape, 3), dtype=np.float32)),
        "scale": 0.0,
        "to_world": mi.ScalarTransform4f(np.array(turn, dtype=np.float64)),
    }


def _medium_box(
    mi: ModuleType,
    grid: TurbidGrid,
    reflectance: list[float],
    transmittance: list[float],
    ground_z_m: float,
) -> tuple[dict, np.ndarray]:
    """A cube of turbid medium with one layer of empty voxels around the filled ones.

    The faces of the cube lie within the empty layer, off its middle, so that they coincide with
    neither voxel faces, nor sensors on a regular grid, nor the ground.
    """
    size = grid.voxel_size_m
    extinction = np.pad(SPHERICAL_G * grid.plant_area_density_m2_m3, 1)
    low = grid.low_m - size
    high = low + size * np.array(extinction.shape)
    inset_low, inset_high = np.full(3, 0.382 * size), np.full(3, 0.382 * size)
    if abs(low[2] + inset_low[2] - ground_z_m) < 0.1 * size:
        inset_low[2] = 0.618 * size
    box = np.stack([low + inset_low, high - inset_high])
    albedo = np.minimum(np.add(reflectance, transmittance), 1.0)
    cube = {
        "type": "cube",
        "id": "voxels",
        "to_world": _affine(mi, box.mean(axis=0), 0.5 * (box[1] - box[0])),
        "bsdf": {"type": "null"},
        "interior": {
            "type": "heterogeneous",
            "albedo": {"type": "rgb", "value": albedo.tolist()},
            "sigma_t": {
                "type": "gridvolume",
                # Mitsuba's grids run z, y, x, channel
                "grid": mi.VolumeGrid(
                    np.ascontiguousarray(extinction.transpose(2, 1, 0)[..., None], np.float32)
                ),
                "filter_type": "nearest",
                "to_world": _affine(mi, low, high - low),
            },
            "phase": {
                "type": "leaf_phase",
                "reflectance": mi.ScalarColor3f(reflectance),
                "transmittance": mi.ScalarColor3f(transmittance),
            },
        },
    }
    return cube, box
