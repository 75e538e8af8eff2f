"""glTF 2.0 (`.glb`) of meshes with materials, for Blender and other viewers."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import trimesh

from dapple.formats.atomic import atomic
from dapple.formats.meshes import Mesh


def write(
    path: str | Path,
    meshes: Mapping[str, tuple[Mesh, np.ndarray | None, np.ndarray]],
) -> None:
    """Write meshes, each a node of its own name.

    Parameters
    ----------
    path : path
        Ends in `.glb`. Axes are glTF's: x east, y up, z south [m].
    meshes : mapping
        By name: the mesh in the local frame; the places (k, 3) that it stands at, or None where it
        is; its colour (3,), linear red, green and blue from 0 to 1. Both sides are seen.
    """
    scene = trimesh.Scene()
    for name, (mesh, places_m, colour) in meshes.items():
        material = trimesh.visual.material.PBRMaterial(
            name=name,
            baseColorFactor=np.round(255.0 * np.append(np.clip(colour, 0.0, 1.0), 1.0)).astype(
                np.uint8
            ),
            metallicFactor=0.0,
            roughnessFactor=1.0,
            doubleSided=True,
        )
        visual = trimesh.visual.TextureVisuals(material=material)
        geometry = trimesh.Trimesh(
            _turned(mesh.vertices_m), mesh.faces, process=False, visual=visual
        )
        places = np.zeros((1, 3)) if places_m is None else places_m
        for number, place in enumerate(_turned(places)):
            move = np.eye(4)
            move[:3, 3] = place
            node = f"{name}_{number}"
            if number == 0:
                scene.add_geometry(geometry, node_name=node, geom_name=name, transform=move)
            else:
                scene.graph.update(node, geometry=name, matrix=move)
    with atomic(path) as partial:
        partial.write_bytes(scene.export(file_type="glb"))


def _turned(xyz_m: np.ndarray) -> np.ndarray:
    """East, north, up to east, up, south."""
    x, y, z = np.asarray(xyz_m, np.float64).T
    return np.stack([x, z, -y], axis=1)
