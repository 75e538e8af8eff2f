"""A wide scene in tiles: sensors of a tile are traced with what stands in it and around it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import pandas as pd

from dapple.formats.meshes import Mesh, concatenate
from dapple.light.by_sensor import OfSensors
from dapple.scene.sensors import POSITION
from dapple.scene.surfaces import Scene, Surface

PIECE = 100_000
"""Triangles that are looked at together."""

Traced = TypeVar("Traced", bound=OfSensors)


@dataclass(frozen=True)
class Tiling:
    """How a scene is cut.

    Attributes
    ----------
    size_m : float
        Side of the square tiles [m]; 0: one tile holds everything.
    lowest_sun_deg : float
        A ray from a sensor at this height above the horizon [°] or higher meets, within the tile
        and its margin, all that it meets in the whole scene.
    far_triangle_m : float
        Beyond the margin a few triangles about so long stand for many small ones [m].

    Notes
    -----
    Only rays lower than `lowest_sun_deg` reach what is beyond. A level sensor has sin² of that
    angle of the light of an even sky from there, 3 % at 10°: at most so much of the sky's light
    would be too much if nothing stood beyond. Therefore small triangles are kept by chance, with
    probability p, and lengthened by 1/√p, as in Cook et al. (2007, Stochastic simplification of
    aggregate detail). Their area, angles, heights and optics stay the same in the mean; of leaves
    that stand by chance, as many rays are let through (a Boolean model). What is left of the error
    comes from clumps narrower than `far_triangle_m`. All of this holds for paths of scattered light
    too, which leave a tile as rays do.
    """

    size_m: float
    lowest_sun_deg: float
    far_triangle_m: float

    def margin_m(self, scene: Scene, sensors: pd.DataFrame) -> float:
        """How far around a tile everything is kept: the longest shadow [m].

        Lengthened triangles reach less than `far_triangle_m` from where they were, also upwards.
        """
        low_m = min(scene.ground_z_m, sensors["z_m"].min())
        height_m = scene.bounds_m[1, 2] - low_m + self.far_triangle_m
        return float(height_m / np.tan(np.radians(self.lowest_sun_deg)) + self.far_triangle_m)


def by_tile(
    scene: Scene,
    sensors: pd.DataFrame,
    tiling: Tiling,
    seed: int,
    trace: Callable[[Scene, pd.DataFrame], Traced],
) -> Traced:
    """Trace sensors tile by tile.

    Parameters
    ----------
    scene : Scene
        All of it.
    sensors : pandas.DataFrame
        `x_m`, `y_m` tell their tile.
    tiling : Tiling
    seed : int
        Of the choice of triangles beyond the margin.
    trace : callable
        Of a scene and some sensors.

    Returns
    -------
    Traced
        Of all sensors, in their order.
    """
    if not tiling.size_m or not scene.filled:
        return trace(scene, sensors)
    margin_m = tiling.margin_m(scene, sensors)
    number = np.floor(sensors[POSITION[:2]].to_numpy() / tiling.size_m)
    tiles, tile_of = np.unique(number, axis=0, return_inverse=True)
    print(f"{len(tiles)} tiles of {tiling.size_m:g} m, each with {margin_m:.1f} m around it")
    orders = [np.flatnonzero(tile_of.ravel() == index) for index in range(len(tiles))]

    def of_tile(tile: np.ndarray, mine: np.ndarray) -> Traced:
        low_m = tile * tiling.size_m - margin_m
        window_m = np.array([low_m, low_m + tiling.size_m + 2 * margin_m])
        part = seen_from(scene, window_m, tiling.far_triangle_m, seed)
        print(f"{len(mine)} sensors, {triangles(part)} of {triangles(scene)} triangles")
        return trace(part, sensors.iloc[mine])

    parts = [of_tile(tile, mine) for tile, mine in zip(tiles, orders, strict=True)]
    return parts[0].joined(parts).of(np.argsort(np.concatenate(orders)))


def triangles(scene: Scene) -> int:
    """How many are stored, those of plants at many places once."""
    return sum(len(surface.mesh.faces) for surface in scene.surfaces)


def seen_from(scene: Scene, window_m: np.ndarray, far_triangle_m: float, seed: int) -> Scene:
    """A scene with all that reaches into a window, and with fewer, longer triangles beyond.

    Terrain, voxels and plants stored once for many places stay whole: a voxel or a place takes few
    bytes.

    Parameters
    ----------
    scene : Scene
    window_m : (2, 2) float64
        Its lower and upper corner, east and north [m].
    far_triangle_m : float
        Longest edge that a triangle is lengthened to [m].
    seed : int
    """
    surfaces = [
        surface
        if surface.optics == scene.ground_optics or surface.places_m is not None
        else _surface(surface, window_m, far_triangle_m, np.random.default_rng([seed, number]))
        for number, surface in enumerate(scene.surfaces)
    ]
    return replace(scene, surfaces=surfaces)


def _surface(
    surface: Surface, window_m: np.ndarray, far_triangle_m: float, rng: np.random.Generator
) -> Surface:
    """Its triangles in the window and those that stand for the others."""
    mesh, near, far = surface.mesh, [], []
    for at in range(0, len(mesh.faces), PIECE):
        corner_m = mesh.vertices_m[mesh.faces[at : at + PIECE]]
        low_m, high_m = corner_m.min(axis=1)[:, :2], corner_m.max(axis=1)[:, :2]
        inside = ((high_m >= window_m[0]) & (low_m <= window_m[1])).all(axis=1)
        near.append(inside)
        # Chance is drawn for all, so that every tile sees the same ones far away.
        chance = rng.random(len(corner_m))[~inside]
        far.append(_lengthened(corner_m[~inside], far_triangle_m, chance))
    if not near:
        return surface
    inside = np.concatenate(near)
    return replace(surface, mesh=concatenate([_of_faces(mesh, inside), _apart(far)]))


def _lengthened(corner_m: np.ndarray, far_triangle_m: float, chance: np.ndarray) -> np.ndarray:
    """(k, 3, 3) triangles that stand for (n, 3, 3): long ones as they are, few of the short."""
    edge_m = np.linalg.norm(corner_m - np.roll(corner_m, 1, axis=1), axis=2).max(axis=1)
    kept_share = np.minimum((edge_m / far_triangle_m) ** 2, 1.0)
    kept = chance < kept_share
    middle_m = corner_m[kept].mean(axis=1, keepdims=True)
    return middle_m + (corner_m[kept] - middle_m) / np.sqrt(kept_share[kept])[:, None, None]


def _apart(corners_m: list[np.ndarray]) -> Mesh:
    """Triangles that share no corner, each an element."""
    vertices_m = np.concatenate(corners_m).reshape(-1, 3)
    count = np.arange(len(vertices_m), dtype=np.int32)
    return Mesh(vertices_m, count.reshape(-1, 3), count[: len(vertices_m) // 3])


def _of_faces(mesh: Mesh, kept: np.ndarray) -> Mesh:
    """Some triangles of a mesh and the corners that they use."""
    faces, element = mesh.faces[kept], mesh.element[kept]
    used = np.zeros(len(mesh.vertices_m), bool)
    used[faces] = True
    number = np.cumsum(used, dtype=np.int32) - 1
    order = np.cumsum(np.diff(element, prepend=element[:1]) != 0, dtype=np.int32)
    return Mesh(mesh.vertices_m[used], number[faces], order)
