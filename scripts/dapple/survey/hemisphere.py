"""A hemispherical time-of-flight scanner in a stand, modelled on the SICK LMS200."""

from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numba import njit, prange

from dapple import engine
from dapple.errors import InputError
from dapple.formats.meshes import concatenate
from dapple.formats.shots import Shots
from dapple.streams import stream_seed
from dapple.survey.hemisphere_scanner import Hemisphere
from dapple.virtual.scanner_beam import beam_pattern, sub_rays
from dapple.virtual.scanner_world import World, mitsuba_mesh, trace
from dapple.virtual.stands import Stand

CHUNK_BEAMS = 1 << 16
"""Beams traced together: always this many, so that one kernel serves and results repeat."""


@dataclass(frozen=True)
class Beams:
    """Some beams of one scan and how far each came.

    Attributes
    ----------
    origin_m : (3,) float64
        Scanner, frame of the stand [m].
    direction : (n, 3) float64
        Unit vectors.
    range_m : (n, r) float64
        Ranges of the returns, near to far; infinite where there is none [m].
    bits : (n,) uint16
        Bit k is set where the beam is part of the scan with the k-th azimuth step.
    """

    origin_m: np.ndarray
    direction: np.ndarray
    range_m: np.ndarray
    bits: np.ndarray

    def shots(self, bit: int, number: int) -> Shots:
        """The beams of one azimuth step as shots of scan `number`."""
        chosen = np.flatnonzero(self.bits >> bit & 1)
        range_m = self.range_m[chosen]
        returned = np.isfinite(range_m)
        nothing = np.full(np.count_nonzero(returned), np.nan, np.float32)
        return Shots(
            np.tile(self.origin_m, (len(chosen), 1)),
            self.direction[chosen],
            np.full(len(chosen), number, np.uint16),
            np.r_[0, np.cumsum(returned.sum(axis=1))],
            range_m[returned],
            nothing,
            nothing,
            np.zeros(3),
        )


def world_of(stand: Stand) -> World:
    """The stand as a scene in which every tree that was grown is stored once."""
    mi: ModuleType = engine.load()
    centre = np.append(0.5 * stand.size_m[:2], 0.0)
    scene: dict[str, Any] = {"type": "scene"}
    for k, plant in enumerate(stand.plants):
        mesh = mitsuba_mesh(mi, concatenate([plant.leaves, plant.wood]), np.zeros(3))
        scene[f"plant_{k}"] = {"type": "shapegroup", "mesh": mesh}
    for tree, grown in enumerate(stand.grown):
        matrix = stand.placement(tree)
        matrix[:3, 3] -= centre
        scene[f"tree_{tree}"] = {
            "type": "instance",
            "to_world": mi.ScalarTransform4f(matrix.tolist()),
            "group": {"type": "ref", "id": f"plant_{grown}"},
        }
    nothing = np.empty(0)
    return World(mi, mi.load_dict(scene), centre, nothing, nothing, nothing)


def scan(
    world: World,
    stand: Stand,
    position_m: np.ndarray,
    scanner: Hemisphere,
    n_positions: int,
    seed: int,
) -> Iterator[Beams]:
    """Fire one hemispherical scan.

    Parameters
    ----------
    world : World
        From `world_of`.
    position_m : (3,) float64
        Scanner, frame of the stand [m].
    scanner : Hemisphere
    n_positions : int
        So many positions share the beams of the design.
    seed : int
        Phase of the azimuths and turn of each beam's pattern.

    Yields
    ------
    Beams

    Raises
    ------
    InputError
        The scanner stands outside the volume or inside a tree.
    """
    position_m = np.asarray(position_m, np.float64)
    check_position(world, stand, position_m)
    n_azimuth, n_zenith = scanner.n_azimuth(n_positions), scanner.n_zenith
    rng = np.random.default_rng(stream_seed(seed, "hemisphere"))
    phase = rng.uniform()
    zenith = (np.arange(n_zenith) + 0.5) * np.radians(90 / n_zenith)
    multiples = np.array(scanner.multiples)
    bits_of_line = (
        (np.arange(n_azimuth)[:, None] % multiples == 0) << np.arange(len(multiples))
    ).sum(1)
    pattern = beam_pattern(scanner.sub_rays)
    rays = np.zeros((6, CHUNK_BEAMS * len(pattern)), np.float32)
    n_beams = n_azimuth * n_zenith
    for first in range(0, n_beams, CHUNK_BEAMS):
        number = np.arange(first, min(first + CHUNK_BEAMS, n_beams))
        line, row = np.divmod(number, n_zenith)
        azimuth, sine = 2 * np.pi * (line + phase) / n_azimuth, np.sin(zenith[row])
        direction = np.column_stack(
            [sine * np.sin(azimuth), sine * np.cos(azimuth), np.cos(zenith[row])]
        )
        origin = np.tile(position_m - world.shift_m, (len(number), 1))
        sub_rays(
            origin,
            direction,
            rng.uniform(0, 2 * np.pi, len(number)),
            pattern,
            0.5 * scanner.exit_aperture_m,
            0.5e-3 * scanner.beam_divergence_mrad,
            rays,
        )
        hit_m, _ = trace(world, rays, scanner.max_range_m)
        range_m = returns(
            hit_m.reshape(-1, len(pattern))[: len(number)],
            scanner.reflectance / len(pattern),
            scanner.min_energy,
            scanner.pulse_m,
            scanner.max_returns,
        )
        yield Beams(position_m, direction, range_m, bits_of_line[line].astype(np.uint16))


@njit(cache=True, parallel=True)
def returns(hit_m, energy_of_ray, min_energy, pulse_m, max_returns):
    """Ranges at which each beam reflects enough energy within a pulse's length.

    Parameters
    ----------
    hit_m : (n, k) float32
        Range of what each sub-ray meets; infinite for a miss [m].
    energy_of_ray : float
        Share of the beam's energy that one sub-ray reflects.
    min_energy : float
        Share that the detector needs.
    pulse_m : float
        Hits within this range reflect together [m].
    max_returns : int
        Later returns are lost.

    Returns
    -------
    (n, max_returns) float64
        Range of the hit that completes the energy of each return; infinite where there is none [m].
    """
    n, k = hit_m.shape
    need = max(int(np.ceil(min_energy / energy_of_ray - 1e-9)), 1)
    result = np.full((n, max_returns), np.inf)
    for i in prange(n):
        sorted_m = np.sort(hit_m[i])
        found, first = 0, 0
        while found < max_returns and first + need <= k:
            near, far = sorted_m[first], sorted_m[first + need - 1]
            if far == np.inf:
                break
            if far - near > pulse_m:
                first += 1
                continue
            result[i, found] = far
            found += 1
            # what lies within the pulse is part of this return
            while first < k and sorted_m[first] - near <= pulse_m:
                first += 1
    return result


def check_position(world: World, stand: Stand, position_m: np.ndarray) -> None:
    """Raise InputError where a scanner cannot stand."""
    if (position_m < 0).any() or (position_m > stand.size_m).any():
        raise InputError(
            "survey.positions_m",
            f"a scanner at {_text(position_m)} m",
            f"a place from 0 to {_text(stand.size_m)} m",
            "Move it into survey.volume_m.",
        )
    if is_inside_wood(world, position_m):
        raise InputError(
            "survey.positions_m",
            f"a scanner at {_text(position_m)} m, inside a trunk",
            "a place from which the stand can be seen",
            "Move the scanner or the tree.",
        )


def is_inside_wood(world: World, position_m: np.ndarray, trunk_m: float = 1.5) -> bool:
    """Whether something closer than `trunk_m` stands in every horizontal direction."""
    azimuth = 2 * np.pi * np.arange(64) / 64
    rays = np.zeros((6, 64), np.float32)
    rays[:3] = (np.asarray(position_m) - world.shift_m)[:, None]
    rays[3], rays[4] = np.sin(azimuth), np.cos(azimuth)
    return bool(np.isfinite(trace(world, rays, trunk_m)[0]).all())


def _text(point_m: np.ndarray) -> str:
    return ", ".join(f"{value:g}" for value in point_m)
