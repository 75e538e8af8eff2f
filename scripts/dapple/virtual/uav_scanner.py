"""A laser scanner under a UAV: parallel flight lines over a world, several returns a pulse."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dapple.errors import InputError
from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh
from dapple.progress import followed
from dapple.streams import stream_seed
from dapple.virtual.scanner_model import Scanner
from dapple.virtual.scanner_returns import echoes
from dapple.virtual.scanner_world import World, build

CHUNK_PULSES = 1 << 16
"""Pulses traced together: always this many, so that one kernel serves and results repeat."""

WHITE_INTENSITY = 20_000
"""Intensity of a white plate that takes the whole beam at the flying height."""

TURN_S = 10.0
"""From the end of one flight line to the start of the next."""


@dataclass(frozen=True)
class Flight:
    """How the UAV flies and what its scanner is like.

    Beam and noise are plausible for small scanners of 905 nm; the height and the density of points
    are those of Zhao et al. (2025).

    Attributes
    ----------
    height_m : float
        Above the mean ground.
    line_spacing_m : float
        Between parallel flight lines, which run north and south in turn.
    half_swath_deg : float
        Largest angle from the nadir, across the line.
    pulses_per_m2 : float
        Mean over the area, all lines together.
    speed_m_s : float
        It gives the pulses their time.
    scan_lines_per_s : float
        Sweeps of the mirror from one side to the other.
    beam_divergence_mrad : float
        Full angle between the 1/e² edges.
    sub_rays : int
        Rays of equal energy that make up one beam.
    range_noise_m : float
        Standard deviation of one echo's range.
    min_separation_m : float
        Echoes closer than this merge into one.
    max_returns : int
        Nearest returns that are kept of a pulse.
    min_energy : float
        Weakest echo, as a share of what a white plate returns.
    leaf_reflectance, wood_reflectance, ground_reflectance : float
        At 905 nm and normal incidence.
    reflectance_sd_db : float
        Standard deviation over shoots, branches and patches of ground.
    """

    height_m: float = 50.0
    line_spacing_m: float = 17.5
    half_swath_deg: float = 35.0
    pulses_per_m2: float = 950.0
    speed_m_s: float = 5.0
    scan_lines_per_s: float = 120.0
    beam_divergence_mrad: float = 1.5
    sub_rays: int = 7
    range_noise_m: float = 0.015
    min_separation_m: float = 0.5
    max_returns: int = 5
    min_energy: float = 0.03
    leaf_reflectance: float = 0.45
    wood_reflectance: float = 0.35
    ground_reflectance: float = 0.3
    reflectance_sd_db: float = 0.5

    def scanner(self) -> Scanner:
        """The beam and detector, as the terrestrial scanner's model describes them."""
        surfaces: dict[str, Any] = {
            f"{kind}_reflectance_db": (
                10 * np.log10(getattr(self, f"{kind}_reflectance")),
                self.reflectance_sd_db,
            )
            for kind in ("leaf", "wood", "ground")
        }
        return Scanner(
            beam_divergence_mrad=self.beam_divergence_mrad,
            exit_aperture_m=0.01,
            sub_rays=self.sub_rays,
            min_range_m=1.0,
            max_range_m=5.0 * self.height_m,
            range_noise_m=self.range_noise_m,
            min_separation_m=self.min_separation_m,
            max_returns=self.max_returns,
            min_energy=self.min_energy,
            noise_points_per_shot=0.0,
            incidence_exponent=1.0,
            **surfaces,
        )


@dataclass(frozen=True)
class Pulses:
    """Pulses in the order in which they are fired.

    Attributes
    ----------
    origin_m, direction : (n, 3) float64
        Where the UAV is, local frame [m]; unit vectors.
    time_s : (n,) float64
        Since the start of the flight [s].
    angle_deg : (n,) float64
        From the nadir across the line, positive to the right of the flight direction.
    line : (n,) uint16
        Number of the flight line, from 1.
    """

    origin_m: np.ndarray
    direction: np.ndarray
    time_s: np.ndarray
    angle_deg: np.ndarray
    line: np.ndarray


def scan(
    meshes: dict[str, Mesh],
    flight: Flight,
    *,
    low_m: tuple[float, float],
    high_m: tuple[float, float],
    ground_z_m: float,
    origin_m: np.ndarray,
    seed: int,
) -> Iterator[Cloud]:
    """Fly over a world and report the returns, chunk by chunk.

    Parameters
    ----------
    meshes : dict of str to Mesh
        `leaf`, `wood`, `ground`, local frame.
    flight : Flight
    low_m, high_m : (2,) float
        The area: pulses are aimed at it, and returns outside are left out [m].
    ground_z_m : float
        Mean height of the ground [m].
    origin_m : (3,) float64
        World coordinates of the local origin.
    seed : int
        Same seed, same bytes.

    Yields
    ------
    Cloud
        Attributes `Intensity` (uint16, linear in energy, falling with the square of range),
        `ReturnNumber`, `NumberOfReturns`, `ScanAngle` [°], `GpsTime` [s], `PointSourceId`
        (flight line) and `Truth` (class code).
    """
    low, high = np.asarray(low_m, float), np.asarray(high_m, float)
    scanner = flight.scanner()
    centre = np.append(0.5 * (low + high), ground_z_m)
    world = build(meshes, None, centre, scanner, seed)
    for number, pulses in enumerate(_chunks(flight, low, high, ground_z_m, seed)):
        rng = np.random.default_rng(stream_seed(seed, "pulses", number))
        cloud = _fire(world, flight, scanner, pulses, rng)
        inside = np.all((cloud.xyz_m[:, :2] >= low) & (cloud.xyz_m[:, :2] < high), axis=1)
        cloud = cloud.select(inside)
        yield Cloud(cloud.xyz_m, np.asarray(origin_m, float), cloud.attributes)


def _fire(world: World, flight: Flight, scanner: Scanner, pulses: Pulses, rng) -> Cloud:
    n = len(pulses.time_s)
    returns, first = echoes(
        world, scanner, pulses.origin_m, pulses.direction, rng, CHUNK_PULSES
    ).nearest_first(n, scanner.max_returns)
    shot, range_m = returns.shot, returns.range_m
    count = np.diff(first)
    energy = 10.0 ** (0.1 * returns.reflectance_db) * (flight.height_m / range_m) ** 2
    return Cloud(
        pulses.origin_m[shot] + range_m[:, None] * pulses.direction[shot],
        attributes={
            "Intensity": np.clip(np.rint(WHITE_INTENSITY * energy), 1, 65535).astype(np.uint16),
            "ReturnNumber": (np.arange(len(shot)) - first[shot] + 1).astype(np.uint8),
            "NumberOfReturns": count[shot].astype(np.uint8),
            "ScanAngle": pulses.angle_deg[shot].astype(np.float32),
            "GpsTime": pulses.time_s[shot],
            "PointSourceId": pulses.line[shot],
            "Truth": returns.truth,
        },
    )


def _chunks(flight, low_m, high_m, ground_z_m, seed) -> Iterator[Pulses]:
    """`CHUNK_PULSES` pulses at a time, the last chunk fewer."""
    waiting, n_waiting = [], 0
    for part in _sweeps(flight, low_m, high_m, ground_z_m, seed):
        waiting.append(part)
        n_waiting += len(part.time_s)
        while n_waiting >= CHUNK_PULSES:
            whole = _joined(waiting)
            yield _slice(whole, 0, CHUNK_PULSES)
            waiting = [_slice(whole, CHUNK_PULSES, n_waiting)]
            n_waiting -= CHUNK_PULSES
    if n_waiting:
        yield _joined(waiting)


def lines_m(flight: Flight, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
    """East coordinates of the flight lines: those whose swath reaches the area [m]."""
    swath_m = flight.height_m * np.tan(np.radians(flight.half_swath_deg))
    middle, half = 0.5 * (low_m[0] + high_m[0]), 0.5 * (high_m[0] - low_m[0]) + swath_m
    n = int(half / flight.line_spacing_m - 0.5 + 1e-9)
    return middle + flight.line_spacing_m * (np.arange(-n - 1, n + 1) + 0.5)


def _sweeps(flight: Flight, low_m, high_m, ground_z_m, seed) -> Iterator[Pulses]:
    """Pulses of some seconds of flight, those that are aimed at the area."""
    per_metre, n_across = _pulse_rate(flight)
    # Crowns stand above the ground: beams that pass over the edge may still meet them.
    length_m = high_m[1] - low_m[1] + 10.0
    n_sweeps, at_once, number = int(np.ceil(length_m * per_metre / n_across)), 256, 0
    lines = followed(lines_m(flight, low_m, high_m), "flight lines")
    for line, x in enumerate(lines, start=1):
        start = np.array([x, 0.5 * (low_m[1] + high_m[1]), ground_z_m + flight.height_m])
        begun_s = (line - 1) * (length_m / flight.speed_m_s + TURN_S)
        for begin in range(0, n_sweeps, at_once):
            rng = np.random.default_rng(stream_seed(seed, "sweeps", number))
            number += 1
            sweep = np.arange(begin, min(begin + at_once, n_sweeps))
            place_m = (sweep[:, None] * n_across + np.arange(n_across)).ravel() / per_metre
            angle = _mirror(flight, sweep, n_across, rng)
            pulses = _shot(flight, line, start, place_m, place_m - 0.5 * length_m, angle, rng)
            pulses = replace(pulses, time_s=pulses.time_s + begun_s)
            yield _select(pulses, _aimed(pulses, low_m, high_m, flight.height_m))


def _pulse_rate(flight: Flight) -> tuple[float, int]:
    """Pulses a metre of line, and pulses a sweep, so that all lines together are dense enough."""
    swath_m = 2 * flight.height_m * np.tan(np.radians(flight.half_swath_deg))
    per_metre = flight.pulses_per_m2 * flight.line_spacing_m
    per_sweep = per_metre * flight.speed_m_s / flight.scan_lines_per_s
    if per_sweep < 2 or swath_m < flight.line_spacing_m:
        raise InputError(
            "chlorophyll.world.lidar_pulses_per_m2",
            f"{per_sweep:.1f} pulses a sweep, a swath of {swath_m:.0f} m, lines "
            f"{flight.line_spacing_m:g} m apart",
            "at least 2 pulses, and a swath that reaches the next line",
            "Fire more pulses, fly more lines or widen the swath.",
        )
    return per_metre, round(per_sweep)


def _mirror(flight: Flight, sweep: np.ndarray, n_across: int, rng) -> np.ndarray:
    """Angle of each pulse [rad]: even steps on level ground, to and fro."""
    across = (np.arange(n_across) + 0.5) / n_across
    side = np.where(sweep[:, None] % 2, -1.0, 1.0) * (2 * across - 1)
    aside = np.clip(side.ravel() + rng.normal(0, 1e-3, side.size), -1, 1)
    return np.arctan(aside * np.tan(np.radians(flight.half_swath_deg)))


def _shot(flight: Flight, line: int, start, place_m, along_m, angle, rng) -> Pulses:
    """Pulses of one line; odd lines fly north, even ones south."""
    n, north = len(angle), 1.0 if line % 2 else -1.0
    origin = np.tile(start, (n, 1))
    origin[:, 1] += north * along_m
    pitch = rng.normal(0.0, 2e-3, n)
    direction = np.column_stack([north * np.sin(angle), pitch, -np.cos(angle)])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    time_s = place_m / flight.speed_m_s
    return Pulses(origin, direction, time_s, np.degrees(angle), np.full(n, line, np.uint16))


def _aimed(pulses: Pulses, low_m, high_m, height_m: float) -> np.ndarray:
    """Whether the lower half of a beam's way, down to below the ground, comes over the area."""
    near, far = (
        pulses.origin_m[:, 0] + share * height_m * pulses.direction[:, 0] / -pulses.direction[:, 2]
        for share in (0.4, 1.2)
    )
    return (np.maximum(near, far) > low_m[0]) & (np.minimum(near, far) < high_m[0])


def _select(pulses: Pulses, chosen) -> Pulses:
    return Pulses(*(values[chosen] for values in vars(pulses).values()))


def _slice(pulses: Pulses, begin: int, end: int) -> Pulses:
    return _select(pulses, slice(begin, end))


def _joined(parts: list[Pulses]) -> Pulses:
    columns = zip(*(vars(part).values() for part in parts), strict=True)
    return Pulses(*(np.concatenate(column) for column in columns))
