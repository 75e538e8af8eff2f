"""The only place that converts axes, directions and offsets.

Everywhere else: metres, right-handed, x east, y north, z up, a local origin subtracted;
azimuth clockwise from north, zenith from straight up.
"""

import numpy as np
from numpy.typing import ArrayLike

FLOAT32_LIMIT_M = 8192.0
"""Up to here neighbouring float32 numbers are at most 1 mm apart (2**13 m, 24 bits)."""


# --- directions -----------------------------------------------------------------------------


def direction_from_angles(zenith_deg: ArrayLike, azimuth_deg: ArrayLike) -> np.ndarray:
    """Unit vectors that point towards a place in the sky.

    Parameters
    ----------
    zenith_deg, azimuth_deg : array_like, broadcast together to shape s
        Zenith angle from straight up; azimuth clockwise from north, as in pvlib [°].

    Returns
    -------
    s + (3,) float64
        East, north, up. The sun's light travels along the negative of it.
    """
    zenith, azimuth = np.broadcast_arrays(np.radians(zenith_deg), np.radians(azimuth_deg))
    horizontal = np.sin(zenith)
    return np.stack(
        [horizontal * np.sin(azimuth), horizontal * np.cos(azimuth), np.cos(zenith)], axis=-1
    )


def across(normal: np.ndarray) -> np.ndarray:
    """Two unit vectors (..., 2, 3) at right angles to unit vectors (..., 3) and to each other.

    Of straight up they are east and north (Duff et al. 2017, JCGT 6(1), 1-8).
    """
    x, y, z = np.moveaxis(np.asarray(normal, float), -1, 0)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return np.stack([first, second], axis=-2)


def angles_from_direction(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Zenith (0 to 180) and azimuth (0 to 360, clockwise from north) of vectors [°].

    Vectors of shape (..., 3) of any length; the inverse of `direction_from_angles`.
    Straight up and straight down have azimuth 0.
    """
    direction = np.asarray(direction, float)
    east, north, up = np.moveaxis(direction, -1, 0)
    zenith = np.degrees(np.arctan2(np.hypot(east, north), up))
    azimuth = np.degrees(np.arctan2(east, north)) % 360.0
    # A tiny negative angle rounds up to 360 in the modulo.
    return zenith, np.where(azimuth == 360.0, 0.0, azimuth)


def scanner_rotation(roll_deg: float, pitch_deg: float, yaw_deg: float) -> np.ndarray:
    """Rotation from a scanner's own frame to the local frame, (3, 3).

    Turns about the scanner's x by `roll_deg`, then about y by `pitch_deg`, then about z by
    `yaw_deg`, each counter-clockwise seen from the axis' tip: v_local = R @ v_scanner.
    """
    (cx, cy, cz), (sx, sy, sz) = (
        f(np.radians([roll_deg, pitch_deg, yaw_deg])) for f in (np.cos, np.sin)
    )
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def scanner_angles_deg(rotation: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of which `scanner_rotation` makes a rotation (3, 3) [°]."""
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    pitch = np.arcsin(np.clip(-rotation[2, 0], -1.0, 1.0))
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    return float(np.degrees(roll)), float(np.degrees(pitch)), float(np.degrees(yaw))


# --- offsets --------------------------------------------------------------------------------


def choose_origin(xyz_m: np.ndarray) -> np.ndarray:
    """A local origin that lets float32 hold the coordinates to a millimetre.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        World coordinates [m], finite.

    Returns
    -------
    (3,) float64
        On each axis whose coordinates exceed 8192 m the least one, floored to 10 m; else 0.
    """
    xyz_m = np.asarray(xyz_m, float)
    if not len(xyz_m):
        return np.zeros(3)
    low, high = xyz_m.min(axis=0), xyz_m.max(axis=0)
    too_far = np.maximum(np.abs(low), np.abs(high)) > FLOAT32_LIMIT_M
    return np.where(too_far, np.floor(low / 10.0) * 10.0, 0.0)


def to_local(world_m: np.ndarray, origin_m: np.ndarray) -> np.ndarray:
    """World coordinates to the local frame, in float64, shape (..., 3) [m]."""
    return np.asarray(world_m, np.float64) - np.asarray(origin_m, np.float64)


def to_world(local_m: np.ndarray, origin_m: np.ndarray) -> np.ndarray:
    """Local coordinates to the world, in float64, shape (..., 3) [m]."""
    return np.asarray(local_m, np.float64) + np.asarray(origin_m, np.float64)


# --- axes of other programs -----------------------------------------------------------------


def local_to_less(xyz_m: np.ndarray) -> np.ndarray:
    """Local (east, north, up) to the vertex order of LESS' OBJ files: v (-x, z, y)."""
    x, y, z = np.moveaxis(np.asarray(xyz_m, float), -1, 0)
    return np.stack([-x, z, y], axis=-1)


def less_to_local(abc_m: np.ndarray) -> np.ndarray:
    """A vertex `v a b c` of a LESS OBJ file to local (east, north, up): (-a, c, b)."""
    a, b, c = np.moveaxis(np.asarray(abc_m, float), -1, 0)
    return np.stack([-a, c, b], axis=-1)


def local_to_less3(xyz_m: np.ndarray, corner_m: np.ndarray) -> np.ndarray:
    """Local (east, north, up) to places in a scene of LESS 3: (east, south, up) of its corner.

    `corner_m` (3,) is the north-western corner of the scene on the ground, local frame [m]. An OBJ
    file of LESS in local coordinates lies right when its object is placed where the origin is.
    """
    x, y, z = np.moveaxis(np.asarray(xyz_m, float) - corner_m, -1, 0)
    return np.stack([x, -y, z], axis=-1)


def local_to_gltf(xyz_m: np.ndarray) -> np.ndarray:
    """Local (east, north, up) to the axes of glTF: x east, y up, z south."""
    x, y, z = np.moveaxis(np.asarray(xyz_m, float), -1, 0)
    return np.stack([x, z, -y], axis=-1)


def gltf_to_local(xyz_m: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) in the axes of glTF to local (east, north, up)."""
    x, y, z = np.moveaxis(np.asarray(xyz_m, float), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def local_to_dart(xyz_m: np.ndarray) -> np.ndarray:
    """Local (east, north, up) to the vertex order of DART's OBJ files: v (y, z, x).

    DART takes an OBJ file as x forward and y up, "v y z x" (pytools4dart user guide,
    "Object 3D", CESBIO); its scenes have z up, and x and y as here.
    """
    x, y, z = np.moveaxis(np.asarray(xyz_m, float), -1, 0)
    return np.stack([y, z, x], axis=-1)


def dart_to_local(abc_m: np.ndarray) -> np.ndarray:
    """A vertex `v a b c` of a DART OBJ file to local (east, north, up): (c, a, b)."""
    a, b, c = np.moveaxis(np.asarray(abc_m, float), -1, 0)
    return np.stack([c, a, b], axis=-1)
