"""A reconstruction fired at: which shots of a scan it would end, and where.

It needs no truth and no light: what a scanner saw from a place that the reconstruction does not
know is predicted, and compared with what it did see.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from dapple.formats.clouds import LEAF, WOOD, Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.scene import traced
from dapple.scene.surfaces import Scene
from dapple.streams import stream_seed
from dapple.virtual import scanner_world
from dapple.virtual.scanner_model import Scanner
from dapple.virtual.scanner_returns import echoes

CHUNK_SHOTS = 1 << 16
MARGIN_M = 0.05
"""The box of the plant is wider than its points by this."""
CROWN_QUANTILE = 0.95
"""Of the points' distances from the crown's axis: its radius."""
WEAKEST = 0.002
"""Quantile of the reflectance of returns: what is weaker is not detected."""


@dataclass(frozen=True)
class Crown:
    """The box and the axis of a plant.

    Attributes
    ----------
    low_m, high_m : (3,) float64
        Corners of the box [m].
    axis_m : (2,) float64
        East and north of the crown's axis [m].
    radius_m : float
        Of the crown [m].
    """

    low_m: np.ndarray
    high_m: np.ndarray
    axis_m: np.ndarray
    radius_m: float


def crown_of(cloud: Cloud) -> Crown:
    """Box, axis and radius of a classified cloud."""
    points_m = cloud.xyz_m
    is_leaf = cloud.attributes["Classification"] == LEAF
    leaf_m = points_m[is_leaf] if is_leaf.any() else points_m
    axis_m = 0.5 * (leaf_m.min(axis=0) + leaf_m.max(axis=0))[:2]
    away = np.hypot(*(leaf_m[:, :2] - axis_m).T)
    return Crown(
        points_m.min(axis=0) - MARGIN_M,
        points_m.max(axis=0) + MARGIN_M,
        axis_m,
        float(np.quantile(away, CROWN_QUANTILE)),
    )


def scanner_of(cloud: Cloud, shots: Iterable[Shots], **settings: float) -> Scanner:
    """A scanner that sees leaf and wood as bright as they are in a scan.

    Parameters
    ----------
    cloud : Cloud
        Classified. With `Reflectance` [dB] the medians of leaf and wood are those of the scan.
    shots : iterable of Shots
        What is weaker than almost all of their returns is not detected.
    **settings
        Beam and detector: fields of `Scanner`.
    """
    reflectance_db = cloud.attributes.get("Reflectance")
    returned_db = np.concatenate([chunk.reflectance_db for chunk in shots])
    returned_db = returned_db[np.isfinite(returned_db)]
    bright = {}
    for name, code in (("leaf", LEAF), ("wood", WOOD)):
        own = cloud.attributes["Classification"] == code
        values = np.zeros(1) if reflectance_db is None else reflectance_db[own]
        values = values[np.isfinite(values)]
        middle = float(np.median(values)) if len(values) else 0.0
        bright[f"{name}_reflectance_db"] = (middle, 0.0)
    if reflectance_db is not None and len(returned_db):
        settings["min_energy"] = float(10 ** (0.1 * np.quantile(returned_db, WEAKEST)))
    # Medians are those of surfaces at all angles already.
    return Scanner(**bright, **settings, incidence_exponent=0.0, range_noise_m=0.0)  # type: ignore[arg-type]


def first_ranges(
    meshes: dict[str, Mesh],
    voxels: xr.Dataset | None,
    chunks: Iterable[Shots],
    crown: Crown,
    scanner: Scanner,
    *,
    seed: int,
) -> Iterator[tuple[Shots, np.ndarray]]:
    """Predict the first return of every shot.

    Beams have a section: a part of them may pass and a part be returned, returns nearer than the
    scanner can part merge, and weak ones are not detected. In turbid voxels the beam's axis goes
    as far as chance lets it.

    Parameters
    ----------
    meshes : dict of str to Mesh
        `leaf` and `wood`, as far as there are such.
    voxels : xarray.Dataset or None
        Turbid leaves.
    chunks : iterable of Shots
    crown : Crown
        Its middle is where rays are finest.
    scanner : Scanner
    seed : int

    Yields
    ------
    shots : Shots
        A chunk of at most `CHUNK_SHOTS`.
    range_m : (n,) float64
        First return within the scene; infinite where there is none.
    """
    filled = {name: mesh for name, mesh in meshes.items() if len(mesh.faces)}
    middle_m = 0.5 * (crown.low_m + crown.high_m)
    world = scanner_world.build(filled, None, middle_m, scanner, seed) if filled else None
    turbid = None
    if voxels is not None:
        turbid = traced.load(Scene((), voxels, ground_z_m=float(crown.low_m[2]) - 1.0))
    for number, shots in enumerate(chunks):
        rng = np.random.default_rng(stream_seed(seed, "rescan", number))
        range_m = np.full(len(shots), np.inf)
        if world is not None:
            found = echoes(world, scanner, shots.origin_m, shots.direction, rng, CHUNK_SHOTS)
            np.minimum.at(range_m, found.shot, found.range_m)
        if turbid is not None and turbid.grid is not None:
            range_m = np.minimum(range_m, _free_path_m(turbid, shots, rng))
        yield shots, range_m


def _free_path_m(scene: traced.TracedScene, shots: Shots, rng: np.random.Generator) -> np.ndarray:
    """How far beams get in turbid voxels [m], (n,); infinite where they get through."""
    mi, n = scene.mi, len(shots)
    columns = np.zeros((7, CHUNK_SHOTS), np.float32)
    columns[5] = 1.0
    columns[:3, :n], columns[3:6, :n] = shots.origin_m.T, shots.direction.T
    columns[6, :n] = -np.log(1.0 - rng.random(n))
    x, y, z, dx, dy, dz, depth = (mi.Float(column) for column in columns)
    found, _ = scene.grid.march(
        mi.Point3f(x, y, z), mi.Vector3f(dx, dy, dz), mi.Float(np.inf), depth, mi.Bool(True)
    )
    return np.array(found, np.float64)[:n]
