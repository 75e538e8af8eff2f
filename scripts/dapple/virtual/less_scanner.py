"""A virtual tree scanned by LESS 3, which shares no code with dapple's own scanner."""

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dapple import frames, less3
from dapple.formats import less_obj
from dapple.formats.meshes import Mesh, concatenate
from dapple.streams import stream_seed
from dapple.virtual.scanner_model import Scanner
from dapple.virtual.scanner_returns import Returns
from dapple.virtual.scanner_world import KINDS, brightness_db

RUNNER = Path(__file__).with_name("less_scanner_run.py")
WAVELENGTH_NM = 1550.0
STEP_DB = 0.5
"""Elements of one kind are as bright as one another within such a step."""
AROUND_M = 5.0
"""The world of LESS reaches so far beyond scanners and plant."""
DARK_BELOW_M = 1.0
"""Where there is no ground, LESS gets a black one so far below everything."""
LEAST_STEP_M = 0.015
"""Finest step of range: the time that LESS takes grows with the square of their number."""
SAMPLE_M2 = 1e-4
"""Area of surface for each point by which a return finds what it comes from."""


@dataclass(frozen=True)
class World:
    """A folder that LESS reads, and the surfaces that its returns come from.

    Attributes
    ----------
    folder : Path
    facts : dict
        What `less_scanner_run.py` reads beside the pulses.
    corner_m : (3,) float64
        As in `frames.local_to_less3`.
    surface : cKDTree
        Points on all surfaces, local frame [m].
    truth : (n,) uint8
        Class code of each of them.
    """

    folder: Path
    facts: dict[str, Any]
    corner_m: np.ndarray
    surface: cKDTree
    truth: np.ndarray


@contextmanager
def shooter(
    meshes: dict[str, Mesh],
    ground_z_m: float | None,
    reach_m: tuple[np.ndarray, np.ndarray],
    scanner: Scanner,
    seed: int,
) -> Iterator[partial[Returns]]:
    """`echoes` of a world, which lasts as long as the context.

    Parameters
    ----------
    meshes : dict of str to Mesh
        By names of `KINDS`, local frame.
    ground_z_m : float or None
        Height of a flat ground [m]; None: there is none.
    reach_m : two (3,) float64
        Corners of a box around scanners and plant, local frame [m].
    scanner : Scanner
    seed : int

    Raises
    ------
    InputError
        LESS 3 is not installed.
    """
    less3.check("scan.program: less")
    low, high = reach_m[0] - AROUND_M, reach_m[1] + AROUND_M
    below_m = low[2] - DARK_BELOW_M if ground_z_m is None else ground_z_m
    corner_m = np.array([low[0], high[1], below_m])
    with tempfile.TemporaryDirectory(prefix="dapple-less-") as name:
        facts = _write(Path(name), meshes, scanner, seed) | {
            "size_m": (high - low)[:2].tolist(),
            "place_m": frames.local_to_less3(np.zeros((1, 3)), corner_m)[0].tolist(),
            "ground": 0.0 if ground_z_m is None else _share(scanner.ground_reflectance_db[0]),
        }
        points, truth = _surfaces(meshes, seed)
        world = World(Path(name), facts, corner_m, cKDTree(points), truth)
        yield partial(echoes, world, ground_z_m)


def echoes(
    world: World,
    ground_z_m: float | None,
    origin_m: np.ndarray,
    direction: np.ndarray,
    enter_m: np.ndarray,
    leave_m: np.ndarray,
    _rng: np.random.Generator,
) -> Returns:
    """Fire beams and report the echoes that LESS finds.

    Parameters
    ----------
    origin_m, direction : (n, 3) float64
        Beam axes, local frame.
    enter_m, leave_m : (n,) float64
        Ranges within which each beam's echoes are looked for [m].
    _rng : numpy.random.Generator
        Not used: LESS 3.0.0 draws the same numbers in every run.

    Returns
    -------
    Returns
        Reflectance is the echo's peak over that of a white plate across the beam at its range.
        LESS tells no deviation of the pulse's shape: it is NaN.
    """
    pulses = np.empty((len(direction), 6), np.float32)
    pulses[:, :3] = frames.local_to_less3(origin_m, world.corner_m)
    pulses[:, 3:] = frames.local_to_less3(direction, np.zeros(3))
    np.save(world.folder / "pulses.npy", pulses)
    np.save(world.folder / "window.npy", np.stack([enter_m, leave_m], axis=1))
    (world.folder / "world.json").write_text(json.dumps(world.facts))
    print(less3.run(RUNNER, world.folder, makes="returns.npy"))
    shot, range_m, of_white = np.load(world.folder / "returns.npy")
    shot = shot.astype(np.int64)
    place_m = origin_m[shot] + direction[shot] * range_m[:, None]
    far_m, nearest = world.surface.query(place_m)
    truth = world.truth[nearest]
    if ground_z_m is not None:
        truth = np.where(np.abs(place_m[:, 2] - ground_z_m) < far_m, KINDS["ground"], truth)
    return Returns(
        shot,
        range_m,
        10.0 * np.log10(of_white),
        np.full(len(shot), np.nan),
        truth.astype(np.uint8),
    )


def _write(folder: Path, meshes: dict[str, Mesh], scanner: Scanner, seed: int) -> dict[str, Any]:
    """Write the world's triangles in groups of like brightness; give groups and scanner."""
    names: list[str] = []
    reflectance, groups, parts = [], [], []
    for kind, mesh in meshes.items():
        level = np.rint(brightness_db(kind, mesh, scanner, seed) / STEP_DB).astype(int)
        levels, of_element = np.unique(level, return_inverse=True)
        groups.append(len(names) + of_element[mesh.element])
        names += [f"{kind}_{number}" for number in range(len(levels))]
        reflectance += [_share(STEP_DB * one) for one in levels]
        parts.append(mesh)
    less_obj.write(folder / "world.obj", concatenate(parts), names, np.concatenate(groups))
    return {
        "wavelength_nm": WAVELENGTH_NM,
        "reflectance": dict(zip(names, reflectance, strict=True)),
        "range_min_m": scanner.min_range_m,
        "range_max_m": scanner.max_range_m,
        # ranges are rounded to these steps: an error as large as the scanner's
        "range_step_m": max(np.sqrt(12.0) * scanner.range_noise_m, LEAST_STEP_M),
        "scanner": {
            "beam_divergence": 0.5 * scanner.beam_divergence_mrad,
            "beam_samples": max(1, round(np.sqrt(4.0 / np.pi * scanner.sub_rays))),
            "pulse_fwhm": scanner.pulse_length_m / 0.15,
            "max_returns": scanner.max_returns,
        },
    }


def _share(db: float) -> float:
    """Decibels below a white plate to reflectance, at most 1."""
    return float(min(1.0, 10.0 ** (0.1 * db)))


def _surfaces(meshes: dict[str, Mesh], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) spread over all triangles by their area, and their class codes."""
    points, truth = [], []
    for kind, mesh in meshes.items():
        rng = np.random.default_rng(stream_seed(seed, "surfaces", kind))
        n = 1 + rng.poisson(mesh.triangle_area_m2 / SAMPLE_M2)
        corners = mesh.vertices_m[np.repeat(mesh.faces, n, axis=0)]
        weight = rng.dirichlet([1.0, 1.0, 1.0], n.sum())
        points.append(np.einsum("nk,nkx->nx", weight, corners))
        truth.append(np.full(n.sum(), KINDS[kind], np.uint8))
    return np.concatenate(points), np.concatenate(truth)
