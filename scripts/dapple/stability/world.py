"""Worlds for the stability map: a tree, its needles and neighbours, wind, scans, sensors, skies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats import shots as shot_files
from dapple.formats.ground_surface import flat
from dapple.formats.meshes import Mesh, concatenate
from dapple.formats.shots import Shots
from dapple.scene import sensors
from dapple.sky.sky_radiance import sky_dataset
from dapple.sky.sun import Site, clear_sky, position
from dapple.stability.stressors import Conditions
from dapple.streams import stream_seed
from dapple.times import time_range
from dapple.virtual import leaf_shapes, scanner
from dapple.virtual.plants import apple_tree

NEEDLE_LENGTH_M = 0.025
GUST_WAVELENGTH_M = 0.6
GUST_WAVES = 24
OVERCAST_SHARE = 0.3
"""Of a cloudless sky's light that is left where all light is diffuse: an ordinary overcast day."""


@dataclass(frozen=True)
class Setup:
    """The configured run that stressors disturb, section by section, as keyword arguments.

    Attributes
    ----------
    plant, scan, clean, classify, polygons, surfels, voxels, leaves : dict
        As the rules of the same names pass them on.
    sizes_m : sequence of float
        Edges of the voxels [m].
    optics : dict
        As rule `optics` passes it on.
    sensors : dict
        `columns`, `rows`, `spacing_m`, `height_m`.
    site, time, radiation, atmosphere : dict
        As rule `sky` passes them on.
    light : dict
        `model` and `tracing`, keyword arguments of `light_model.Model` and `Tracing`; `variant` and
        `truth_factor`, how many times more rays the truth gets.
    fill_range_m : float
        As in the section `corrections` [m].
    ground_z_m : float
        Height of the ground [m].
    """

    plant: Mapping[str, Any]
    scan: Mapping[str, Any]
    clean: Mapping[str, Any]
    classify: Mapping[str, Any]
    polygons: Mapping[str, Any]
    surfels: Mapping[str, Any]
    voxels: Mapping[str, Any]
    leaves: Mapping[str, Any]
    sensors: Mapping[str, Any]
    site: Mapping[str, Any]
    time: Mapping[str, Any]
    radiation: Mapping[str, Any]
    atmosphere: Mapping[str, Any]
    light: Mapping[str, Any] = field(default_factory=dict)
    sizes_m: Sequence[float] = (0.2, 1.0)
    optics: Mapping[str, Any] = field(default_factory=dict)
    fill_range_m: float = 0.5
    ground_z_m: float = 0.0


def grow(setup: Setup, conditions: Conditions, seed: int) -> dict[str, Mesh]:
    """Grow the tree and, where there is one, its neighbour.

    Parameters
    ----------
    setup : Setup
    conditions : Conditions
        Leaf area, size, kind and angles, distance of the second tree.
    seed : int
        Another seed is another tree.

    Returns
    -------
    dict of str to Mesh
        `leaf` and `wood`. More leaf area sits on the same wood.
    """
    settings = dict(setup.plant)
    factor = conditions.leaf_area_factor
    settings["leaf_area_m2"] *= factor
    settings["leaf_angle_distribution"] = conditions.leaf_angles
    # Branches grow towards points in proportion to leaf area: keep the wood as it is.
    settings["twigs_per_leaf_m2"] = settings.get("twigs_per_leaf_m2", 25.0) / factor
    if conditions.leaf_length_m is not None:
        middle = 0.5 * (settings["leaf_length_min_m"] + settings["leaf_length_max_m"])
        for end in ("leaf_length_min_m", "leaf_length_max_m"):
            settings[end] *= conditions.leaf_length_m / middle
    trees = [_tree(settings, conditions, stream_seed(seed, "tree"))]
    if conditions.second_tree_m < inf:
        azimuth = np.random.default_rng(stream_seed(seed, "neighbour")).uniform(0, 2 * np.pi)
        beside = conditions.second_tree_m * np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
        second = _tree(settings, conditions, stream_seed(seed, "second tree"))
        trees.append({kind: moved(mesh, beside) for kind, mesh in second.items()})
    return {kind: concatenate([tree[kind] for tree in trees]) for kind in ("leaf", "wood")}


def _tree(settings: dict, conditions: Conditions, seed: int) -> dict[str, Mesh]:
    plant = apple_tree(**settings, seed=seed)
    leaves = plant.leaves
    if conditions.needle_width_m:
        rng = np.random.default_rng(stream_seed(seed, "needles"))
        leaves = needles(leaves, conditions.needle_width_m, NEEDLE_LENGTH_M, rng)
    return {"leaf": leaves, "wood": plant.wood}


def needles(leaves: Mesh, width_m: float, length_m: float, rng: np.random.Generator) -> Mesh:
    """Put a tuft of flat needles of the same area in the place of every leaf.

    Parameters
    ----------
    leaves : Mesh
        Blades.
    width_m, length_m : float
        Of a needle [m].
    rng : numpy.random.Generator
        Directions of the needles: even over the sphere; they start within the blade's reach.

    Returns
    -------
    Mesh
        One element a needle, two triangles each; together the area of the leaves to within a
        needle.
    """
    area_m2 = leaves.element_area_m2
    ends = np.round(np.cumsum(area_m2) / (width_m * length_m)).astype(int)
    leaf = np.repeat(np.arange(len(area_m2)), np.diff(ends, prepend=0))
    n = len(leaf)
    centre = leaves.vertices_m.reshape(leaves.n_elements, -1, 3).mean(axis=1)
    along, across = (_unit(rng.standard_normal((n, 3))) for _ in range(2))
    across = _unit(np.cross(along, across))
    spread = 0.5 * np.sqrt(area_m2)[leaf, None] * rng.standard_normal((n, 3))
    foot = centre[leaf] + spread - 0.5 * length_m * along
    side = 0.5 * width_m * across
    corners = np.stack(
        [foot - side, foot + side, foot + side + length_m * along, foot - side + length_m * along],
        axis=1,
    )
    return leaf_shapes.repeat_pattern(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def moved(mesh: Mesh, by_m: np.ndarray) -> Mesh:
    """A mesh moved by (3,) or, one for each vertex, (v, 3) metres."""
    return Mesh(mesh.vertices_m + by_m, mesh.faces, mesh.element)


def in_wind(leaves: Mesh, displacement_m: float, rng: np.random.Generator) -> Mesh:
    """Leaves displaced as a gust would: neighbours together, others another way.

    Parameters
    ----------
    leaves : Mesh
        Elements of equal make-up.
    displacement_m : float
        Root mean square displacement [m].
    rng : numpy.random.Generator
        Draws the gust: a sum of waves about `GUST_WAVELENGTH_M` long.
    """
    centre = leaves.vertices_m.reshape(leaves.n_elements, -1, 3).mean(axis=1)
    wave = _unit(rng.standard_normal((GUST_WAVES, 3))) * (2 * np.pi / GUST_WAVELENGTH_M)
    wave *= rng.uniform(0.5, 1.5, (GUST_WAVES, 1))
    phase = rng.uniform(0, 2 * np.pi, GUST_WAVES)
    way = _unit(rng.standard_normal((GUST_WAVES, 3)))
    shift = np.sin(centre @ wave.T + phase) @ way * np.sqrt(2 / GUST_WAVES) * displacement_m
    per_element = len(leaves.vertices_m) // leaves.n_elements
    return moved(leaves, np.repeat(shift, per_element, axis=0))


def scan(
    setup: Setup, conditions: Conditions, plant: dict[str, Mesh], seed: int
) -> tuple[Shots, np.ndarray]:
    """Scan a plant under the conditions of a survey.

    Parameters
    ----------
    setup, conditions
        Positions, step, reflectance, noise, wind, misregistration, share of shots.
    plant : dict of str to Mesh
        What truly stands there.
    seed : int

    Returns
    -------
    shots : Shots
        Of all positions, as the user would get them.
    positions_m : (k, 3) float64
        Where the scanner stood.
    """
    settings = dict(setup.scan)
    n = settings.pop("positions") if conditions.positions is None else conditions.positions
    settings.pop("positions", None)
    positions_m = around(
        n, conditions.span_deg, settings.pop("radius_m"), settings.pop("height_m"), seed
    )
    positions_m[:, 2] += setup.ground_z_m
    if conditions.angular_step_deg is not None:
        settings["angular_step_deg"] = conditions.angular_step_deg
    if conditions.reflectance_gap_db is not None:
        leaf, wood = settings["leaf_reflectance_db"], settings["wood_reflectance_db"]
        middle, half = 0.5 * (leaf[0] + wood[0]), 0.5 * conditions.reflectance_gap_db
        settings["leaf_reflectance_db"] = (middle - half, leaf[1])
        settings["wood_reflectance_db"] = (middle + half, wood[1])
    settings |= {"seed": stream_seed(seed, "scan"), "ground_z_m": setup.ground_z_m}
    # A gust moves leaves, not the box that is scanned.
    vertices = np.concatenate([mesh.vertices_m for mesh in plant.values()])
    settings["window_m"] = vertices.min(axis=0), vertices.max(axis=0)
    if conditions.wind_m:
        parts = []
        for number, place in enumerate(positions_m):
            rng = np.random.default_rng(stream_seed(seed, "wind", number))
            swayed = plant | {"leaf": in_wind(plant["leaf"], conditions.wind_m, rng)}
            part = scanner.scan(swayed, place[None], **settings)
            parts.append(replace(part, scan=part.scan + np.uint16(number)))
        shots = shot_files.concatenate(parts)
    else:
        shots = scanner.scan(plant, positions_m, **settings)
    rng = np.random.default_rng(stream_seed(seed, "survey"))
    if conditions.noise_share:
        shots = with_noise(shots, conditions.noise_share, setup.ground_z_m, rng)
    if conditions.kept_share < 1:
        shots = shot_files.select(shots, rng.random(len(shots)) < conditions.kept_share)
    if conditions.misregistration_m:
        shots = misregistered(shots, conditions.misregistration_m, rng)
    return shots, positions_m


def around(n: int, span_deg: float, radius_m: float, height_m: float, seed: int) -> np.ndarray:
    """Scan positions (n, 3) on an arc around the stem, the whole circle without a repeat [m]."""
    if span_deg >= 360:
        azimuth = 2 * np.pi * np.arange(n) / n
    else:
        first = np.random.default_rng(stream_seed(seed, "side")).uniform(0, 2 * np.pi)
        half = 0.5 * np.radians(span_deg)
        azimuth = first + (np.linspace(-half, half, n) if n > 1 else np.zeros(1))
    return np.stack(
        [radius_m * np.sin(azimuth), radius_m * np.cos(azimuth), np.full(n, height_m)], axis=1
    )


def misregistered(shots: Shots, shift_m: float, rng: np.random.Generator) -> Shots:
    """Shots of every scan but the first moved by `shift_m`, each scan in its own direction."""
    numbers, which = np.unique(shots.scan, return_inverse=True)
    shift = shift_m * _unit(rng.standard_normal((len(numbers), 3)))
    shift[0] = 0.0
    return replace(shots, origin_m=shots.origin_m + shift[which])


def with_noise(shots: Shots, share: float, ground_z_m: float, rng: np.random.Generator) -> Shots:
    """Add returns without a target that a filter cannot tell by their echo.

    Parameters
    ----------
    shots : Shots
    share : float
        Of the returns in the box of the tree that shall be noise afterwards, 0 to below 1.
    ground_z_m : float
        Noise lies above the ground [m].
    rng : numpy.random.Generator
        Shots with noise, and where along them; echoes are copies of true ones.

    Returns
    -------
    Shots
        True class 7 for the noise.
    """
    xyz = shots.return_xyz_m
    true = np.flatnonzero(xyz[:, 2] > ground_z_m + 0.1)
    low, high = xyz[true].min(axis=0), xyz[true].max(axis=0)
    n = round(share / (1 - share) * len(true))
    # Points even over the box, each on the beam that passes it most nearly: insects, spray.
    shot = rng.integers(0, len(shots), n)
    middle = (0.5 * (low + high) - shots.origin_m[shot]) * shots.direction[shot]
    reach = 0.5 * np.linalg.norm(high - low)
    range_m = np.maximum(middle.sum(axis=1) + reach * rng.uniform(-1, 1, n), 0.5)
    like = rng.choice(true, n)
    all_shot = np.concatenate([shots.shot_of_return, shot])
    all_range = np.concatenate([shots.range_m, range_m.astype(np.float32).astype(np.float64)])
    order = np.lexsort((all_range, all_shot))
    index = np.concatenate([np.arange(len(shots.range_m)), like])[order]
    columns = _returns(shots, index) | {"range_m": all_range[order]}
    if shots.truth is not None:
        columns["truth"] = np.where(order >= len(shots.range_m), 7, columns["truth"]).astype(
            np.uint8
        )
    count = np.bincount(all_shot, minlength=len(shots))
    return replace(shots, first=np.concatenate([[0], np.cumsum(count)]), **columns)


def _returns(shots: Shots, index: np.ndarray) -> dict[str, Any]:
    names = ("range_m", "reflectance_db", "deviation", "truth")
    values = {name: getattr(shots, name) for name in names}
    return {name: None if v is None else v[index] for name, v in values.items()}


def sensors_m(setup: Setup, conditions: Conditions) -> np.ndarray:
    """Places of the sensors around the stem, or in the crown's shadow where the sun is set.

    Returns
    -------
    (s, 3) float64
        Local frame [m]. Under a low sun light comes in below the crown: sensors that stay there
        would see no leaf. They follow the shadow of the crown's middle instead.
    """
    centre = np.zeros(2)
    if conditions.sun_elevation_deg is not None:
        middle_m = 0.5 * (setup.plant["height_m"] + setup.plant["crown_base_m"])
        when = times(setup, conditions)
        sun = _sun(setup, when[[len(when) // 2]]).iloc[0]
        away = np.radians(sun["sun_azimuth_deg"] + 180)
        length_m = middle_m * np.tan(np.radians(sun["sun_zenith_deg"]))
        centre = length_m * np.array([np.sin(away), np.cos(away)])
    table = sensors.grid_around(centre.tolist(), **setup.sensors, ground=flat(setup.ground_z_m))
    return table[["x_m", "y_m", "z_m"]].to_numpy(float)


def times(setup: Setup, conditions: Conditions) -> pd.DatetimeIndex:
    """Times of the series: as configured, or as many minutes about a height of the evening sun."""
    usual = time_range(**setup.time)
    if conditions.sun_elevation_deg is None:
        return usual
    day = pd.date_range(usual[0].normalize(), periods=24 * 60, freq="1min")
    sun = _sun(setup, day)
    off = np.abs(90 - sun["sun_zenith_deg"].to_numpy() - conditions.sun_elevation_deg)
    evening = sun["sun_azimuth_deg"].to_numpy() >= 180
    first = int(np.argmin(np.where(evening, off, np.inf))) - len(usual) // 2
    return day[first : first + len(usual)]


def _sun(setup: Setup, when: pd.DatetimeIndex) -> pd.DataFrame:
    place = Site(**setup.site)
    return position(when, place.latitude_deg, place.longitude_deg, place.altitude_m)


def sky(setup: Setup, conditions: Conditions, offset_min: float = 0.0) -> xr.Dataset:
    """Sun and sky at the times of the series, for a clock that is `offset_min` ahead."""
    when = times(setup, conditions) + pd.Timedelta(minutes=offset_min)
    place = Site(**setup.site)
    radiation = clear_sky(when, place, **setup.radiation)
    if (share := conditions.diffuse_share) is not None:
        total = radiation["global_w_m2"] * (1 - (1 - OVERCAST_SHARE) * share)
        radiation = radiation.assign(global_w_m2=total, diffuse_w_m2=share * total)
    return sky_dataset(when, place, radiation, **setup.atmosphere)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
