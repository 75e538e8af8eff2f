"""A terrestrial laser scanner in a virtual world, modelled on the RIEGL VZ-400i."""

from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.formats.meshes import Mesh, concatenate
from dapple.formats.shots import Shots
from dapple.formats.shots import concatenate as join_shots
from dapple.streams import stream_seed
from dapple.virtual.scanner_beam import beam_pattern, merge_hits, sub_rays
from dapple.virtual.scanner_window import grid_directions, through_box

CHUNK_SHOTS = 1 << 16
"""Shots traced together: always this many, so that one kernel serves and results repeat."""

KINDS = {"leaf": 4, "wood": 0, "ground": 2}
NOISE = 7


@dataclass(frozen=True)
class Scanner:
    """What the scanner is like and how it sees surfaces.

    Defaults follow the VZ-400i's data sheet where it states a value (divergence, field of view,
    precision) and are plausible choices elsewhere.

    Attributes
    ----------
    angular_step_deg : float
        Step of azimuth and zenith angle; Frey et al. (2025) scanned with 0.04°.
    zenith_min_deg, zenith_max_deg : float
        Field of view, 100° from 30° off the zenith.
    beam_divergence_mrad : float
        Full angle between the 1/e² edges.
    exit_aperture_m : float
        1/e² diameter of the beam where it leaves the scanner.
    sub_rays : int
        Rays of equal energy that make up one beam.
    min_range_m, max_range_m : float
        Echoes outside are not recorded.
    range_noise_m : float
        Standard deviation of one echo's range.
    min_separation_m : float
        Echoes closer than this merge into one. A pulse of 3 ns is 0.45 m long in range; the
        echoes of two targets stop touching when they are a little less than twice that apart.
    max_returns : int
        The nearest ones of a shot are kept.
    min_energy : float
        Weakest echo that is detected, as a share of what a white plate returns.
    noise_points_per_shot : float
        Chance that a shot has a return without a target, anywhere along the beam up to where
        it leaves the window.
    leaf_reflectance_db, wood_reflectance_db, ground_reflectance_db : (float, float)
        Mean and standard deviation over elements at normal incidence, relative to a white
        plate. At 1550 nm leaves are darker than bark because of their water, which is why
        Frey et al. (2025) could part them at -5.4 dB.
    reflectance_noise_db : float
        Standard deviation of one echo within an element (texture, speckle).
    incidence_exponent : float
        Reflectance falls with the cosine of incidence to this power: 1 is a Lambertian
        surface, 0 a full correction.
    clean_deviation, clean_deviation_sd : float
        Pulse shape deviation of an echo from one plane target.
    pulse_length_m : float
        Full width at half maximum of the pulse, in range (3 ns).
    noise_reflectance_db : (float, float)
        Mean and standard deviation for returns without a target.
    noise_deviation : float
        Mean (exponential) of their pulse shape deviation.
    """

    angular_step_deg: float = 0.04
    zenith_min_deg: float = 30.0
    zenith_max_deg: float = 130.0
    beam_divergence_mrad: float = 0.35
    exit_aperture_m: float = 0.007
    sub_rays: int = 7
    min_range_m: float = 0.5
    max_range_m: float = 250.0
    range_noise_m: float = 0.005
    min_separation_m: float = 0.8
    max_returns: int = 5
    min_energy: float = 0.01
    noise_points_per_shot: float = 0.001
    leaf_reflectance_db: tuple[float, float] = (-8.0, 1.5)
    wood_reflectance_db: tuple[float, float] = (-3.0, 1.1)
    ground_reflectance_db: tuple[float, float] = (-7.0, 1.5)
    reflectance_noise_db: float = 1.0
    incidence_exponent: float = 0.5
    clean_deviation: float = 3.0
    clean_deviation_sd: float = 2.0
    pulse_length_m: float = 0.45
    noise_reflectance_db: tuple[float, float] = (-16.0, 3.0)
    noise_deviation: float = 40.0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("angular_step_deg", 1e-4, 45.0),
            ("zenith_min_deg", 0.0, self.zenith_max_deg),
            ("zenith_max_deg", self.zenith_min_deg, 180.0),
            ("sub_rays", 1, 64),
            ("max_returns", 1, 255),
            ("noise_points_per_shot", 0.0, 1.0),
            ("max_range_m", self.min_range_m, 1e4),
        ):
            if not low <= getattr(self, name) <= high:
                raise InputError(
                    f"scan.{name}",
                    str(getattr(self, name)),
                    f"{low} to {high}",
                    "Correct the configuration.",
                )


@dataclass(frozen=True)
class _World:
    """What the rays meet, with what an echo needs to know of each triangle."""

    mi: ModuleType
    scene: object
    shift_m: np.ndarray
    normal: np.ndarray
    brightness: np.ndarray
    kind: np.ndarray


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
    return join_shots(scan_chunks(meshes, positions_m, **options))


def scan_chunks(
    meshes: dict[str, Mesh],
    positions_m: np.ndarray,
    *,
    seed: int,
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
    world = _build(meshes, ground_z_m, 0.5 * (low_m + high_m), scanner, seed)
    origin = np.zeros(3) if world_origin_m is None else np.asarray(world_origin_m, np.float64)
    chunks = _chunks_of_beams(positions_m, low_m, high_m, scanner)
    number = -1
    for number, (index, direction) in enumerate(chunks):
        rng = np.random.default_rng(stream_seed(seed, "shots", number))
        position = positions_m[index]
        enter, leave = through_box(position, direction, low_m, high_m)
        returns = _returns(world, scanner, position, direction, np.maximum(enter, leave), rng)
        yield Shots(
            position, direction, (index + 1).astype(np.uint16), *returns[:4], origin, returns[4]
        )
    if number < 0:
        raise InputError(
            "scan.positions_m",
            "no shot that meets the window",
            "the window within the field of view",
            "Move the scanner or widen zenith_min_deg to zenith_max_deg.",
        )


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
    reach = np.abs(beam_pattern(scanner.sub_rays)).max()
    beam = reach * 0.5 * (scanner.exit_aperture_m + 1e-3 * scanner.beam_divergence_mrad * far)
    return low - margin_m - beam, high + margin_m + beam


def _build(meshes, ground_z_m, centre_m, scanner, seed) -> _World:
    """One Mitsuba mesh of everything, near the origin, where float32 is fine enough."""
    parts = {name: mesh for name, mesh in meshes.items() if len(mesh.faces)}
    if unknown := set(parts) - set(KINDS):
        raise InputError(
            "meshes", ", ".join(sorted(unknown)), ", ".join(KINDS), "Rename or leave them out."
        )
    if ground_z_m is not None:
        parts["flat ground"] = _flat_ground(centre_m, ground_z_m, scanner.max_range_m)
    if not parts:
        raise InputError("meshes", "no triangle", "a plant or a ground", "Check the plant.")
    brightness, kind = [], []
    for name, mesh in parts.items():
        surface = name.removeprefix("flat ")
        mean, sd = getattr(scanner, f"{surface}_reflectance_db")
        rng = np.random.default_rng(stream_seed(seed, "reflectance", name))
        of_element = mean + sd * rng.standard_normal(mesh.n_elements)
        brightness.append(10.0 ** (0.1 * of_element[mesh.element]))
        kind.append(np.full(len(mesh.faces), list(KINDS).index(surface), np.uint8))
    whole = concatenate(list(parts.values()))
    double_area = np.linalg.norm(whole.triangle_normal, axis=1, keepdims=True)
    normal = whole.triangle_normal / np.where(double_area > 0.0, double_area, 1.0)
    mi = engine.load()
    mesh = mi.Mesh("world", len(whole.vertices_m), len(whole.faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float((whole.vertices_m - centre_m).ravel())
    parameters["faces"] = mi.UInt32(whole.faces.astype(np.uint32).ravel())
    parameters.update()
    scene = mi.load_dict({"type": "scene", "world": mesh})
    return _World(
        mi,
        scene,
        centre_m,
        normal.astype(np.float32),
        np.concatenate(brightness),
        np.concatenate(kind),
    )


def _flat_ground(centre_m: np.ndarray, z_m: float, reach_m: float) -> Mesh:
    """A square of ground that reaches beyond every range, in pieces of about 1 m near by."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64) * 2.0 * reach_m
    vertices = np.column_stack([corners + centre_m[:2], np.full(4, z_m)])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def _chunks_of_beams(
    positions_m, low_m, high_m, scanner
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Position index and direction of the shots to fire, `CHUNK_SHOTS` at a time."""
    waiting, n_waiting = [], 0
    for index, position in enumerate(positions_m):
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
        yield tuple(np.concatenate(p) for p in zip(*waiting, strict=True))


def _trace(world: _World, rays: np.ndarray, max_range_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Range and triangle of each ray's hit; infinite range for a miss."""
    mi = world.mi
    x, y, z, dx, dy, dz = (mi.Float(row) for row in rays)
    ray = mi.Ray3f(mi.Point3f(x, y, z), mi.Vector3f(dx, dy, dz))
    ray.maxt = max_range_m
    hit = world.scene.ray_intersect_preliminary(ray, coherent=True)
    return np.array(hit.t), np.array(hit.prim_index)


def _returns(world, scanner, position, direction, leave_m, rng) -> tuple[np.ndarray, ...]:
    """`first`, range, reflectance, deviation and class of the returns of one chunk."""
    n, pattern = len(direction), beam_pattern(scanner.sub_rays)
    rays = np.zeros((6, CHUNK_SHOTS * len(pattern)), np.float32)
    rays[5] = 1.0
    sub_rays(
        position - world.shift_m,
        direction,
        2.0 * np.pi * rng.random(n),
        pattern,
        0.5 * scanner.exit_aperture_m,
        0.5e-3 * scanner.beam_divergence_mrad,
        rays,
    )
    hit_range, triangle = _trace(world, rays, scanner.max_range_m)
    n_echoes, *echoes = merge_hits(
        hit_range.reshape(-1, len(pattern))[:n],
        triangle.reshape(-1, len(pattern))[:n],
        rays,
        world.normal,
        world.brightness,
        world.kind,
        scanner.incidence_exponent,
        scanner.min_range_m,
        scanner.min_separation_m,
        scanner.min_energy,
    )
    kept = np.arange(len(pattern)) < n_echoes[:, None]
    range_m, energy, spread, kind = (values[kept] for values in echoes)
    shot = np.repeat(np.arange(n), n_echoes)
    m = len(shot)
    noisy = np.flatnonzero(rng.random(n) < scanner.noise_points_per_shot)
    shot = np.concatenate([shot, noisy])
    range_m = np.concatenate(
        [
            range_m + scanner.range_noise_m * rng.standard_normal(m),
            rng.uniform(scanner.min_range_m, np.minimum(leave_m, scanner.max_range_m)[noisy]),
        ]
    )
    mean, sd = scanner.noise_reflectance_db
    reflectance = np.concatenate(
        [
            10.0 * np.log10(energy) + scanner.reflectance_noise_db * rng.standard_normal(m),
            mean + sd * rng.standard_normal(len(noisy)),
        ]
    )
    deviation = np.concatenate(
        [
            _deviation(spread, scanner, rng),
            scanner.noise_deviation * rng.standard_exponential(len(noisy)),
        ]
    )
    truth = np.concatenate([np.array(list(KINDS.values()))[kind], np.full(len(noisy), NOISE)])
    order = np.lexsort((range_m, shot))
    count = np.bincount(shot, minlength=n)
    rank = np.arange(len(shot)) - np.repeat(np.cumsum(count) - count, count)
    order = order[rank < scanner.max_returns]
    first = np.concatenate([[0], np.cumsum(np.minimum(count, scanner.max_returns))])
    return (
        first.astype(np.int64),
        # float32 first: the file of shots then gives back exactly these numbers
        range_m[order].astype(np.float32).astype(np.float64),
        reflectance[order].astype(np.float32),
        np.rint(deviation[order]).astype(np.float32),
        truth[order].astype(np.uint8),
    )


def _deviation(spread_m: np.ndarray, scanner: Scanner, rng: np.random.Generator) -> np.ndarray:
    """Pulse shape deviation of echoes whose hits spread over some range.

    A Gaussian pulse of standard deviation s that is widened by the variance v differs from its
    own shape, in the mean absolute sense, by 2 φ(1) v / s² of its area (first order in v, φ the
    normal density); deviation is that share in thousandths, on top of the scanner's own.
    """
    pulse_sd_m = scanner.pulse_length_m / np.sqrt(8.0 * np.log(2.0))
    widened = 2.0 * np.exp(-0.5) / np.sqrt(2.0 * np.pi) * (spread_m / pulse_sd_m) ** 2
    clean = scanner.clean_deviation + scanner.clean_deviation_sd * rng.standard_normal(
        len(spread_m)
    )
    return np.abs(clean) + 1000.0 * widened
