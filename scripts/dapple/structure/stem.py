"""Where the stem of a tree stands."""

import numpy as np

from dapple.formats.meshes import Mesh


def stem_position(wood: Mesh, height_m: float = 1.0) -> np.ndarray:
    """Where the stem stands: the area-weighted middle of the lowest wood.

    Parameters
    ----------
    wood : Mesh
        Local frame.
    height_m : float
        Wood up to this height above its lowest point counts [m].

    Returns
    -------
    (3,) float64
        East, north [m], and the height of the lowest point.
    """
    middle = wood.vertices_m[wood.faces].mean(axis=1)
    lowest = wood.vertices_m[:, 2].min()
    weight = wood.triangle_area_m2 * (middle[:, 2] < lowest + height_m)
    east, north = (middle[:, :2] * weight[:, None]).sum(axis=0) / weight.sum()
    return np.array([east, north, lowest])
