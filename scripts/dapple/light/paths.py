"""Backward light paths through meshes and turbid voxels: one Dr.Jit kernel for every scene.

A path starts at a sensor and ends when it leaves the scene. On its way it only counts what it met:
reflections and transmissions by each kind of leaf, reflections by wood, ground and all else. At a
leaf it goes on to either side with equal chance. `Counters.spectral_factor` says what share of
light is left of it in any band: spectra come later.
"""

from dataclasses import dataclass

import drjit as dr
import numpy as np

from dapple.optics import sensor_response
from dapple.optics.responses import COSINE, Response
from dapple.progress import followed
from dapple.scene.traced import TracedScene

PLASTIC_STEPS = (3242174889, 2447445414)
"""2³² over the plastic number and over its square: steps of the R2 sequence (Roberts 2018)."""
PATHS_PER_KERNEL = 1 << 19
"""Bounds memory, a path takes about 150 bytes, and keeps the state of the paths in the cache."""


@dataclass(frozen=True)
class Paths:
    """Paths that left the scene.

    Attributes
    ----------
    start : (m,) int32
        Index of the point where each path started.
    direction : (m, 3) float32
        Unit vector in which it left: its light came from there.
    orders : (m,) uint32 or uint64
        What it met on its way, packed by the scene's `counters`.
    weight : (m,) int64
        Paths that it stands for: a power of two, 1 without random termination.
    cut : (n,) int64
        For each point, paths that were given up at `max_orders`, by their weight.
    """

    start: np.ndarray
    direction: np.ndarray
    orders: np.ndarray
    weight: np.ndarray
    cut: np.ndarray


def trace(
    scene: TracedScene,
    points_m: np.ndarray,
    n_paths: np.ndarray,
    *,
    max_orders: int,
    seed: int,
    first: np.ndarray | int = 0,
    halved_after: int | None = None,
    aperture_m: float = 0.0,
    response: Response = COSINE,
    facing: np.ndarray | None = None,
    keys: np.ndarray | None = None,
) -> Paths:
    """Trace paths backward from sensors.

    Parameters
    ----------
    scene : TracedScene
        What the paths can meet.
    points_m : (n, 3) float64
        Sensors in the local frame [m].
    n_paths : (n,) int64
        Paths from each point; their first directions follow a shifted R2 sequence and are drawn as
        often as light from there counts.
    max_orders : int
        A path that meets more surfaces is given up (and counted as cut); at most 255, less in
        scenes of many kinds of surfaces (`Counters.check`).
    seed : int
        Of the random numbers. A path depends on it, its point's key and its own number, not on
        the number of threads nor on how many paths are traced.
    first : (n,) int64
        Number of each point's first path: to add to paths that were traced before.
    halved_after : int or None
        From this number of surfaces on every second path is ended and the other counts twice.
    aperture_m : float
        Diameter of the sensors' receiving discs [m].
    response : Response
        Of the sensors.
    facing : (n, 3) float64 or None
        Unit normals of the sensors; None: they are level and look up.
    keys : (n,) uint32 or None
        Which random numbers each point draws; None: those of its place in the list.

    Returns
    -------
    Paths
        In order of point and path.
    """
    mi = scene.mi
    scene.counters.check(max_orders)
    n_paths = np.broadcast_to(n_paths, len(points_m)).astype(np.int64)
    first = np.broadcast_to(first, len(points_m)).astype(np.int64)
    ends = np.cumsum(n_paths)
    fixed = [
        dr.opaque(mi.UInt32, seed),
        dr.opaque(mi.UInt32, max_orders),
        dr.opaque(mi.UInt32, max_orders + 1 if halved_after is None else halved_after),
        dr.opaque(mi.Float, 0.5 * aperture_m),
    ]
    points, normals = (
        None if vectors is None else [mi.Float(vectors[:, k].astype(np.float32)) for k in range(3)]
        for vectors in (points_m, facing)
    )
    keys = mi.UInt32((np.arange(len(points_m)) if keys is None else keys).astype(np.uint32))
    every = np.repeat(np.arange(len(points_m)), n_paths)
    parts = []
    for low in followed(range(0, len(every), PATHS_PER_KERNEL), "paths of light from sensors"):
        start = every[low : low + PATHS_PER_KERNEL]
        number = low + np.arange(len(start)) - (ends - n_paths - first)[start]
        parts.append(_trace_block(scene, points, normals, keys, start, number, response, *fixed))
    start, direction, orders, weight, cut = (
        np.concatenate([part[k] for part in parts]) for k in range(5)
    )
    lost = np.bincount(start[cut], weight[cut], len(points_m)).astype(np.int64)
    left = ~cut
    return Paths(start[left], direction[left], orders[left], weight[left], lost)


def _trace_block(
    scene, points, normals, keys, start, number, response, seed, max_orders, halved_after, radius
):
    """Trace the paths of one kernel; those that were absorbed by chance are left out."""
    mi = scene.mi
    n = len(number)
    start, number = mi.UInt32(start.astype(np.uint32)), mi.UInt32(number.astype(np.uint32))
    point, shift = mi.sample_tea_32(dr.gather(mi.UInt32, keys, start), seed)
    state, sequence = mi.sample_tea_32(point + number, shift)
    rng = mi.PCG32(initstate=mi.UInt64(state), initseq=mi.UInt64(sequence))
    flat = mi.warp.square_to_uniform_disk_concentric(_stratified(mi, point, shift, number))
    first = sensor_response.directions(response, flat.x, flat.y, dr.squared_norm(flat), dr)
    on_disc = mi.warp.square_to_uniform_disk(mi.Point2f(rng.next_float32(), rng.next_float32()))
    centre = mi.Point3f(*(dr.gather(mi.Float, axis, start) for axis in points))
    across, first = mi.Vector3f(on_disc.x, on_disc.y, 0), mi.Vector3f(*first)
    if normals is not None:
        turn = mi.Frame3f(mi.Vector3f(*(dr.gather(mi.Float, axis, start) for axis in normals)))
        across, first = turn.to_world(across), turn.to_world(first)
    origin = centre + radius * across
    direction, escaped, alive, weight, orders = _follow(
        mi,
        scene,
        origin,
        first,
        rng,
        dr.full(mi.Bool, True, n),
        max_orders,
        halved_after,
    )
    kept = dr.compress(escaped | alive)
    columns = [dr.gather(type(x), x, kept) for x in (start, direction, orders, weight, escaped)]
    dr.eval(columns)
    start, direction, orders, weight, escaped = (np.array(column) for column in columns)
    return (
        start.astype(np.int32),
        np.ascontiguousarray(direction.T, np.float32),
        orders.astype(scene.counters.word),
        weight.astype(np.int64),
        ~escaped,
    )


def _stratified(mi, first_shift, second_shift, path):
    """Points of the R2 sequence, shifted at random for each sensor."""
    shifts = (first_shift, second_shift)
    u, v = (
        mi.Float(shift + path * mi.UInt32(step)) * 2.0**-32
        for shift, step in zip(shifts, PLASTIC_STEPS, strict=True)
    )
    # The conversion to float32 may round up to 1, which is outside the square.
    return mi.Point2f(dr.minimum(u, dr.one_minus_epsilon(mi.Float)), v)


def scatter(mi, scene, point, normal, leaf, voxel, rng):
    """Draw where light goes on: reflected, or transmitted with an even chance by leaves.

    Returns
    -------
    origin, direction : Point3f, Vector3f
        The next ray; surfaces push it off themselves, a point in a turbid voxel has no surface.
    transmitted : Bool
    """
    square = mi.Point2f(rng.next_float32(), rng.next_float32())
    transmitted = leaf & (rng.next_float32() < 0.5)
    side = dr.select(transmitted, -normal, normal)
    direction = mi.Frame3f(side).to_world(mi.warp.square_to_cosine_hemisphere(square))
    push = dr.select(voxel, 0.0, scene.ray_offset)
    return point + side * push, direction, transmitted


def event(scene, counter, transmitted):
    """One more of what a counter counts, or the next one where a leaf let light through."""
    counter = dr.select(transmitted, counter + 1, counter)
    return scene.word(1) << scene.word(counter * scene.counters.bits)


@dr.syntax
def _follow(mi, scene, origin, direction, rng, active, max_orders, halved_after):
    """Follow paths until they leave the scene; return last directions and what they met."""
    orders, met, weight = scene.word(0), mi.UInt32(0), mi.UInt32(1)
    escaped, cut = mi.Bool(False), mi.Bool(False)
    while dr.hint(active, mode="evaluated", compress=True):
        point, normal, counter, hit, leaf, voxel, crossed = scene.segment(
            origin, direction, rng, active
        )
        hit &= active
        escaped |= active & ~hit & ~crossed
        new_origin, new_direction, transmitted = scatter(mi, scene, point, normal, leaf, voxel, rng)
        orders[hit] = orders + event(scene, counter, transmitted)
        met += dr.select(hit, 1, 0)
        origin[hit] = new_origin
        direction[hit] = new_direction
        origin[active & crossed] = point
        active &= hit | crossed
        cut |= active & (met > max_orders)
        active &= ~cut
        # Weights stay powers of two, so that sums of them stay integers.
        thinned = active & hit & (met >= halved_after)
        dies = thinned & (rng.next_float32() < 0.5)
        weight[thinned] = weight * 2
        active &= ~dies
    return direction, escaped, cut, weight, orders
