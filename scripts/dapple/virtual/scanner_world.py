"""What a scanner's rays meet: leaf, wood and ground as one Mitsuba mesh."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.formats.meshes import Mesh, concatenate
from dapple.streams import stream_seed
from dapple.virtual.scanner_model import Scanner

KINDS = {"leaf": 4, "wood": 0, "ground": 2}
"""Class code of each kind of surface; kinds are numbered in this order."""


@dataclass(frozen=True)
class World:
    """A scene to trace, with what an echo needs to know of each triangle.

    Attributes
    ----------
    mi : module
        Mitsuba, with its variant set.
    scene : mitsuba.Scene
        One mesh, shifted by `-shift_m`, so that float32 is fine enough.
    shift_m : (3,) float64
        Local coordinates of the scene's origin [m].
    normal : (t, 3) float32
        Unit normals.
    brightness : (t,) float64
        Reflectance at normal incidence, of a white plate's.
    kind : (t,) uint8
        Position in `KINDS`.
    """

    mi: ModuleType
    scene: Any
    shift_m: np.ndarray
    normal: np.ndarray
    brightness: np.ndarray
    kind: np.ndarray


def build(
    meshes: dict[str, Mesh],
    ground_z_m: float | None,
    centre_m: np.ndarray,
    scanner: Scanner,
    seed: int,
) -> World:
    """Put the meshes into one scene and draw the brightness of their elements.

    Parameters
    ----------
    meshes : dict of str to Mesh
        By names of `KINDS`, local frame.
    ground_z_m : float or None
        Height of a flat ground that reaches beyond every range [m], or no such ground.
    centre_m : (3,) float64
        Becomes the scene's origin [m].
    scanner : Scanner
        Its reflectance distributions and range.
    seed : int
        An element's brightness depends on it, on the mesh's name and on the element's number.

    Raises
    ------
    InputError
        A name that is no kind of surface, or no triangle at all.
    """
    parts = [(name, mesh) for name, mesh in meshes.items() if len(mesh.faces)]
    if unknown := {name for name, _ in parts} - set(KINDS):
        raise InputError(
            "meshes", ", ".join(sorted(unknown)), ", ".join(KINDS), "Rename or leave them out."
        )
    if ground_z_m is not None:
        parts.append(("ground", _flat_ground(centre_m, ground_z_m, scanner.max_range_m)))
    if not parts:
        raise InputError("meshes", "no triangle", "a plant or a ground", "Check the plant.")
    brightness, kind = [], []
    for name, mesh in parts:
        of_element = brightness_db(name, mesh, scanner, seed)
        brightness.append(10.0 ** (0.1 * of_element[mesh.element]))
        kind.append(np.full(len(mesh.faces), list(KINDS).index(name), np.uint8))
    whole = concatenate([mesh for _, mesh in parts])
    length = np.linalg.norm(whole.triangle_normal, axis=1, keepdims=True)
    normal = whole.triangle_normal / np.where(length > 0.0, length, 1.0)
    mi = engine.load()
    return World(
        mi,
        mi.load_dict({"type": "scene", "world": mitsuba_mesh(mi, whole, centre_m)}),
        centre_m,
        normal.astype(np.float32),
        np.concatenate(brightness),
        np.concatenate(kind),
    )


def brightness_db(name: str, mesh: Mesh, scanner: Scanner, seed: int) -> np.ndarray:
    """(n_elements,) reflectance of each element at normal incidence, of a white plate's [dB]."""
    mean, sd = getattr(scanner, f"{name}_reflectance_db")
    rng = np.random.default_rng(stream_seed(seed, "reflectance", name))
    return mean + sd * rng.standard_normal(mesh.n_elements)


def trace(world: World, rays: np.ndarray, max_range_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Find what each ray meets first.

    Parameters
    ----------
    rays : (6, n) float32
        Origins, relative to the world's shift, and directions.
    max_range_m : float
        Rays end here [m].

    Returns
    -------
    range_m : (n,) float32
        In lengths of the direction; infinite for a miss.
    triangle : (n,) uint32
        Meaningless for a miss.
    """
    mi = world.mi
    x, y, z, dx, dy, dz = (mi.Float(row) for row in rays)
    ray = mi.Ray3f(mi.Point3f(x, y, z), mi.Vector3f(dx, dy, dz))
    ray.maxt = max_range_m
    hit = world.scene.ray_intersect_preliminary(ray, coherent=True)
    return np.array(hit.t), np.array(hit.prim_index)


def mitsuba_mesh(mi: ModuleType, mesh: Mesh, shift_m: np.ndarray) -> object:
    """A Mitsuba mesh without shading normals."""
    result = mi.Mesh("world", len(mesh.vertices_m), len(mesh.faces))
    parameters = mi.traverse(result)
    parameters["vertex_positions"] = mi.Float((mesh.vertices_m - shift_m).ravel())
    parameters["faces"] = mi.UInt32(mesh.faces.astype(np.uint32).ravel())
    parameters.update()
    return result


def _flat_ground(centre_m: np.ndarray, z_m: float, reach_m: float) -> Mesh:
    """Two triangles, one element, that reach beyond every range."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64) * 2.0 * reach_m
    vertices = np.column_stack([corners + centre_m[:2], np.full(4, z_m)])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))
