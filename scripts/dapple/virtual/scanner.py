"""A terrestrial laser scanner in a virtual world, modelled on the RIEGL VZ-400i."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import partial

import numpy as np

from dapple.errors import InputError
from dapple.formats import shots as shot_files
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.progress import followed
from dapple.streams import stream_seed
from dapple.virtual import less_scanner
from dapple.virtual.scanner_beam import beam_pattern
from dapple.virtual.scanner_model import Scanner
from dapple.virtual.scanner_returns import Returns, echoes, false_echoes
from dapple.virtual.scanner_window import grid_directions, through_box
from dapple.virtual.scanner_world import World, build

CHUNK_SHOTS = 1 << 16
"""Shots traced together: always this many, so that one kernel serves and results repeat."""


def positions_around(
    centre_m: np.ndarray, radius_m: float = 10.0, n: int = 8, height_m: float = 1.6
) -> np.ndarray:
    """Scan positions on a circle, the first one north of its centre, then clockwise.

    Parameters
    ----------
    centre_m : (3,) float64
        Centre on the ground, local frame [m].
    radius_m, height_m : float
        Distance from the centre, height of the scanner above it [m].
    n : int
        Number of positions.

    Returns
    -------
    (n, 3) float64
        Local frame [m].
    """
    azimuth = 2.0 * np.pi * np.arange(n) / n
    offset = np.stack(
        [radius_m * np.sin(azimuth), radius_m * np.cos(azimuth), np.full(n, height_m)], axis=1
    )
    return np.asarray(centre_m, np.float64) + offset


def scan(meshes: dict[str, Mesh], positions_m: np.ndarray, **options) -> Shots:
    """All shots of `scan_chunks` at once: for scans that fit into memory."""
    return shot_files.concatenate(scan_chunks(meshes, positions_m, **options))


def scan_chunks(
    meshes: dict[str, Mesh],
    positions_m: np.ndarray,
    *,
    seed: int,
    program: str = "dapple",
    ground_z_m: float | None = None,
    window_m: tuple[np.ndarray, np.ndarray] | None = None,
    window_margin_m: float = 1.0,
    world_origin_m: np.ndarray | None = None,
    **settings,
) -> Iterator[Shots]:
    """Scan a world from several positions, chunk by chunk.

    Parameters
    ----------
    meshes : dict of str to Mesh
        `leaf`, `wood` and, where wanted, `ground`, in the local frame.
    positions_m : (k, 3) float64
        Where the beam leaves the scanner; they get the scan numbers 1 to k.
    seed : int
        Same seed, same bytes.
    program : str
        "dapple": its own scanner; "less": that of LESS 3, which adds no noise of its own.
    ground_z_m : float, optional
        Height of a flat ground without end [m]; without it there is none.
    window_m : two (3,) float64, optional
        Corners of the box that is scanned: a shot is fired, and its misses and returns (also
        those behind the box) are kept, when its axis meets the box. By default the bounding
        box of leaf and wood.
    window_margin_m : float
        The box is padded by this on every side, and by the beam's own width [m].
    world_origin_m : (3,) float64, optional
        World coordinates of the local origin.
    **settings
        Fields of `Scanner`.

    Yields
    ------
    Shots
        `CHUNK_SHOTS` shots each, the last chunk fewer, with the true class of each return.

    Raises
    ------
    InputError
        Nothing to scan, a setting out of range, or no shot in the window.
    """
    scanner = Scanner(**settings)
    positions_m = np.asarray(positions_m, np.float64).reshape(-1, 3)
    low_m, high_m = _window(meshes, positions_m, window_m, window_margin_m, scanner)
    world_origin_m = np.zeros(3) if world_origin_m is None else np.asarray(world_origin_m, float)
    number = -1
    with _shooter(program, meshes, positions_m, ground_z_m, (low_m, high_m), scanner, seed) as fire:
        for number, (index, direction) in enumerate(
            _chunks_of_beams(positions_m, low_m, high_m, scanner)
        ):
            rng = np.random.default_rng(stream_seed(seed, "shots", number))
            origin_m = positions_m[index]
            ends_m = through_box(origin_m, direction, low_m, high_m)
            returns, first = fire(origin_m, direction, *ends_m, rng).nearest_first(
                len(direction), scanner.max_returns
            )
            yield Shots(
                origin_m,
                direction,
                (index + 1).astype(np.uint16),
                first,
                # float32 first: a file of shots then gives back exactly these numbers
                returns.range_m.astype(np.float32).astype(np.float64),
                returns.reflectance_db.astype(np.float32),
                returns.deviation.astype(np.float32),
                world_origin_m,
                returns.truth,
            )
    if number < 0:
        raise InputError(
            "scan.positions_m",
            "no shot that meets the window",
            "the window within the field of view",
            "Move the scanner or widen zenith_min_deg to zenith_max_deg.",
        )


def _shooter(
    program: str,
    meshes: dict[str, Mesh],
    positions_m: np.ndarray,
    ground_z_m: float | None,
    window_m: tuple[np.ndarray, np.ndarray],
    scanner: Scanner,
    seed: int,
) -> AbstractContextManager[Callable[..., Returns]]:
    """What gives the returns of beams (`origin_m`, `direction`, `enter_m`, `leave_m`, `rng`)."""
    if program == "less":
        reach_m = (
            np.minimum(window_m[0], positions_m.min(axis=0)),
            np.maximum(window_m[1], positions_m.max(axis=0)),
        )
        return less_scanner.shooter(meshes, ground_z_m, reach_m, scanner, seed)
    world = build(meshes, ground_z_m, 0.5 * (window_m[0] + window_m[1]), scanner, seed)
    return nullcontext(partial(_fire, world, scanner))


def _fire(
    world: World,
    scanner: Scanner,
    origin_m: np.ndarray,
    direction: np.ndarray,
    enter_m: np.ndarray,
    leave_m: np.ndarray,
    rng: np.random.Generator,
) -> Returns:
    """Returns of dapple's own scanner, false ones among them."""
    found = echoes(world, scanner, origin_m, direction, rng, CHUNK_SHOTS)
    return found.together_with(false_echoes(leave_m, scanner, rng))


def _window(meshes, positions_m, window_m, margin_m, scanner) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box that is scanned, wide enough for beams whose axis passes it by."""
    if window_m is None:
        plant = [meshes[name].vertices_m for name in ("leaf", "wood") if name in meshes]
        vertices = np.concatenate(plant) if plant else np.empty((0, 3))
        if not np.isfinite(vertices).all() or not len(vertices):
            raise InputError(
                "meshes",
                "no or infinite vertices of leaf and wood",
                "a plant",
                "Check the plant, or give window_m.",
            )
        window_m = vertices.min(axis=0), vertices.max(axis=0)
    low, high = (np.asarray(corner, np.float64) for corner in window_m)
    far = np.linalg.norm(positions_m - 0.5 * (low + high), axis=1).max()
    far += np.linalg.norm(high - low)
    reach = np.linalg.norm(beam_pattern(scanner.sub_rays), axis=1).max()
    beam = reach * 0.5 * (scanner.exit_aperture_m + 1e-3 * scanner.beam_divergence_mrad * far)
    return low - margin_m - beam, high + margin_m + beam


def _chunks_of_beams(
    positions_m, low_m, high_m, scanner
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Position index and direction of the shots to fire, `CHUNK_SHOTS` at a time."""
    waiting, n_waiting = [], 0
    for index, position in enumerate(followed(positions_m, "scan positions")):
        for direction in grid_directions(
            position,
            low_m,
            high_m,
            angular_step_deg=scanner.angular_step_deg,
            zenith_min_deg=scanner.zenith_min_deg,
            zenith_max_deg=scanner.zenith_max_deg,
        ):
            waiting.append((np.full(len(direction), index), direction))
            n_waiting += len(direction)
            if n_waiting < CHUNK_SHOTS:
                continue
            indices, directions = (np.concatenate(p) for p in zip(*waiting, strict=True))
            for at in range(0, n_waiting - CHUNK_SHOTS + 1, CHUNK_SHOTS):
                yield indices[at : at + CHUNK_SHOTS], directions[at : at + CHUNK_SHOTS]
            n_waiting %= CHUNK_SHOTS
            waiting = [
                (indices[len(indices) - n_waiting :], directions[len(indices) - n_waiting :])
            ]
    if n_waiting:
        indices, directions = (np.concatenate(p) for p in zip(*waiting, strict=True))
        yield indices, directions
