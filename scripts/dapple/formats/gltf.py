"""glTF 2.0 of meshes with materials, for Blender, other viewers and other light models."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import trimesh

from dapple.errors import InputError
from dapple.formats.atomic import atomic
from dapple.formats.meshes import Mesh
from dapple.frames import gltf_to_local, local_to_gltf


def write(
    path: str | Path,
    meshes: Mapping[str, tuple[Mesh, np.ndarray | None, np.ndarray]],
) -> None:
    """Write meshes, each a node of its own name; of several places nodes are numbered.

    Parameters
    ----------
    path : path
        Ends in `.glb`, or in `.gltf` for text that holds its buffers. Axes are glTF's: x east, y
        up, z south [m].
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
            local_to_gltf(mesh.vertices_m), mesh.faces, process=False, visual=visual
        )
        places = np.zeros((1, 3)) if places_m is None else places_m
        for number, place in enumerate(local_to_gltf(places)):
            move = np.eye(4)
            move[:3, 3] = place
            node = name if places_m is None else f"{name}_{number}"
            if number == 0:
                scene.add_geometry(geometry, node_name=node, geom_name=name, transform=move)
            else:
                scene.graph.update(node, geometry=name, matrix=move)
    with atomic(path) as partial:
        if Path(path).suffix == ".glb":
            partial.write_bytes(scene.export(file_type="glb"))
        else:
            files = trimesh.exchange.gltf.export_gltf(scene, embed_buffers=True)
            partial.write_bytes(files["model.gltf"])


def read(path: str | Path) -> dict[str, Mesh]:
    """Read the meshes of a glTF file, in the local frame, by their nodes in the order of names.

    Raises
    ------
    InputError
        The file is missing, is no glTF, or holds no triangles.
    """
    try:
        scene = trimesh.load_scene(path)
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(
            path, f"no glTF that can be read ({error})", "glTF 2.0", "Export it again."
        ) from error
    found = {}
    for node in sorted(scene.graph.nodes_geometry, key=_by_number):
        move, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or not len(geometry.faces):
            continue
        moved = trimesh.transform_points(geometry.vertices, move)
        faces = np.asarray(geometry.faces, np.int32)
        found[str(node)] = Mesh(gltf_to_local(moved), faces, np.zeros(len(faces), np.int32))
    if not found:
        raise InputError(path, "no triangles", "meshes", "Export it with its geometry.")
    return found


def _by_number(name: str) -> list[tuple[int, str]]:
    """Sorts names so that 2 comes before 10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
