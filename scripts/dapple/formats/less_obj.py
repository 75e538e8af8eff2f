"""Wavefront OBJ as LESS 3 takes it: named groups and flat normals."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dapple import frames
from dapple.formats.meshes import Mesh


def write(
    path: str | Path, mesh: Mesh, names: Sequence[str], group: np.ndarray | None = None
) -> None:
    """Write triangles as named groups in the axes of LESS, with flat normals.

    LESS smooths surfaces without normals. Triangles without area have none and are left out.

    Parameters
    ----------
    path : str or Path
    mesh : Mesh
        Local frame.
    names : sequence of str
        Of the groups.
    group : (t,) int, optional
        The group of every triangle; the first where it is not given.
    """
    group = np.zeros(len(mesh.faces), int) if group is None else group
    normal = frames.local_to_less(mesh.triangle_normal)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    kept = length[:, 0] > 0.0
    corners, group = mesh.faces[kept] + 1, group[kept]
    number = np.arange(1, len(corners) + 1)
    faces = np.stack([corners[:, 0], number, corners[:, 1], number, corners[:, 2], number], axis=1)
    with Path(path).open("w", encoding="ascii", newline="\n") as file:
        file.write("# dapple, metres, axes of LESS: -east, up, north\n")
        np.savetxt(file, frames.local_to_less(mesh.vertices_m), fmt="v %.6f %.6f %.6f")
        np.savetxt(file, normal[kept] / length[kept], fmt="vn %.6f %.6f %.6f")
        for k in np.unique(group):
            file.write(f"g {names[k]}\n")
            np.savetxt(file, faces[group == k], fmt="f %d//%d %d//%d %d//%d")
