"""What a canopy sends back to the sky: bidirectional reflectance factors, fluxes and images.

Paths start at a view and run backward; at every leaf or surface that they meet a shadow ray asks
whether the sun lights it. As in `light.paths` they only count what they met: what a view receives
is a power series in reflectances and transmittances whose coefficients are traced once for all
bands.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import numpy as np
import pandas as pd

from dapple.light.paths import PLASTIC_STEPS, event, scatter
from dapple.scene.counters import Counters
from dapple.scene.scene_optics import Optics
from dapple.scene.traced import TracedScene

PATHS_PER_KERNEL = 1 << 19
SUN, SKY = 0, 1
"""Where light comes from: the sun, or a sky of even radiance."""


@dataclass(frozen=True)
class Views:
    """Level or tilted windows through which light is received.

    Attributes
    ----------
    corner_m, edge_a_m, edge_b_m : (v, 3) float64
        The window, a parallelogram; edges of length 0 make it a line or a point [m].
    axis : (v, 3) float64
        Unit vector in which a view looks.
    cosine : bool
        False: parallel rays along the axis. True: rays from the whole hemisphere around it by a
        cosine law: a flux.
    """

    corner_m: np.ndarray
    edge_a_m: np.ndarray
    edge_b_m: np.ndarray
    axis: np.ndarray
    cosine: bool = False


@dataclass(frozen=True)
class Received:
    """What views receive, as the coefficients of a power series.

    Attributes
    ----------
    view, replicate : (k,) int32
        Which view, which independent set of paths.
    source : (k,) int8
        `SUN` or `SKY`.
    orders : (k, n) uint8
        What paths met, a column for each of `counters`.
    weight : (k,) float64
        Reflectance factor per `Counters.spectral_factor`.
    n_views, n_replicates : int
        How many there are.
    counters : Counters
        What is counted.
    """

    view: np.ndarray
    replicate: np.ndarray
    source: np.ndarray
    orders: np.ndarray
    weight: np.ndarray
    n_views: int
    n_replicates: int
    counters: Counters


def over_cell(
    scene: TracedScene,
    directions: np.ndarray,
    *,
    height_m: float | None = None,
    cosine: bool = False,
) -> Views:
    """Views of a whole repeated cell.

    Parameters
    ----------
    scene : TracedScene
        With a cell.
    directions : (v, 3) float64
        Unit vectors in which the views look.
    height_m : float or None
        Of the level window; None: above all plants [m].
    cosine : bool
        See `Views`.
    """
    assert scene.cell is not None
    low, high = (np.array([corner.x[0], corner.y[0]]) for corner in scene.cell)
    z = float(scene.top_z[0]) + 1.0 if height_m is None else height_m
    shape = (len(directions), 3)
    return Views(
        np.broadcast_to([*low, z], shape),
        np.broadcast_to([high[0] - low[0], 0.0, 0.0], shape),
        np.broadcast_to([0.0, high[1] - low[1], 0.0], shape),
        np.asarray(directions, np.float64),
        cosine,
    )


def collect(
    scene: TracedScene,
    views: Views,
    sun_direction: np.ndarray,
    *,
    n_paths: int,
    max_orders: int,
    seed: int,
    halved_after: int | None = 16,
    n_replicates: int = 16,
) -> Received:
    """Trace paths from views and add up what they receive.

    Parameters
    ----------
    scene : TracedScene
        What light meets.
    views : Views
        Where paths start.
    sun_direction : (3,) float64
        Unit vector towards the sun, above the horizon.
    n_paths : int
        Of each view, in equal parts for every replicate.
    max_orders : int
        Most surfaces on a path, at most 250; less in scenes of many kinds of surfaces.
    seed : int
        Of the random numbers.
    halved_after : int or None
        From this number of surfaces on every second path is ended and the other counts twice.
    n_replicates : int
        Independent sets, at least 2.

    Returns
    -------
    Received
        The same for the same seed, whatever the number of threads.
    """
    scene.counters.check(max_orders)
    n_views, per_set = len(views.axis), -(-n_paths // n_replicates)
    limits = max_orders, max_orders + 1 if halved_after is None else halved_after
    parts = []
    total = n_views * n_replicates * per_set
    for low in range(0, total, PATHS_PER_KERNEL):
        n = min(PATHS_PER_KERNEL, total - low)
        found = _trace_block(
            scene, views, sun_direction, low, n, per_set, n_replicates, *limits, seed
        )
        parts.append(_summed(*found))
    start, orders, weight = _summed(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    start, source = np.divmod(start, 2)
    return Received(
        view=(start // n_replicates).astype(np.int32),
        replicate=(start % n_replicates).astype(np.int32),
        source=source.astype(np.int8),
        orders=scene.counters.unpacked(orders),
        weight=weight / per_set,
        n_views=n_views,
        n_replicates=n_replicates,
        counters=scene.counters,
    )


def reflectance_factor(
    received: Received, optics: Optics, *, diffuse_share: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance factors and their standard errors.

    Parameters
    ----------
    received : Received
        Of v views.
    optics : Optics
        In b bands.
    diffuse_share : float
        Of the light on level ground that comes from a sky of even radiance, not from the sun.

    Returns
    -------
    factor, error : (v, b) float64
        For parallel views the ratio to a white Lambertian plate; for cosine views the ratio of
        the flux through the window to that of the open sky on the level.
    """
    share = np.where(received.source == SUN, 1 - diffuse_share, diffuse_share)
    packed = received.counters.packed(received.orders)
    kinds, kind = np.unique(packed, return_inverse=True)
    row = received.view.astype(np.int64) * received.n_replicates + received.replicate
    shape = received.n_views * received.n_replicates, len(kinds)
    table = np.bincount(row * shape[1] + kind, received.weight * share, shape[0] * shape[1])
    factor = received.counters.spectral_factor(received.counters.unpacked(kinds), optics)
    values = (table.reshape(shape) @ factor).reshape(received.n_views, received.n_replicates, -1)
    return values.mean(axis=1), values.std(axis=1, ddof=1) / np.sqrt(received.n_replicates)


def _summed(
    start: np.ndarray, orders: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distinct pairs of start and orders, and their weights added in the order of their coming."""
    kind, kinds = pd.factorize(orders, sort=True)
    distinct, place = np.unique(start * len(kinds) + kind, return_inverse=True)
    start, kind = np.divmod(distinct, max(len(kinds), 1))
    return start, kinds[kind], np.bincount(place, weight, len(distinct))


def _trace_block(
    scene, views, sun_direction, low, n, per_set, n_replicates, max_orders, halved_after, seed
):
    """Follow n paths; starts, orders and weights of what they bring.

    Paths that have ended are left out after every surface: few go on for long.
    """
    mi = scene.mi
    index = low + np.arange(n)
    start = mi.UInt32((index // per_set).astype(np.uint32))
    number = mi.UInt32((index % per_set).astype(np.uint32))
    point, shift = mi.sample_tea_32(start, dr.opaque(mi.UInt32, seed))
    state, sequence = mi.sample_tea_32(point + number, shift)
    rng = mi.PCG32(initstate=mi.UInt64(state), initseq=mi.UInt64(sequence))
    view = start // dr.opaque(mi.UInt32, n_replicates)
    origin, direction = _first_rays(mi, views, view, (point, shift), number, rng)
    parts = []
    limits = max_orders, halved_after
    for whose, source, met_orders, brought in follow(
        scene, start, origin, direction, rng, sun_direction, *limits
    ):
        if source is None:
            break  # what is left is given up
        parts.append((whose.astype(np.int64) * 2 + source, met_orders, brought.astype(np.float64)))
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


def follow(
    scene: TracedScene,
    start,
    origin,
    direction,
    rng,
    sun_direction: np.ndarray,
    max_orders: int,
    halved_after: int,
) -> Iterator[tuple[np.ndarray, np.ndarray | None, np.ndarray | None, np.ndarray]]:
    """Follow paths surface by surface and give what they bring at each.

    Paths that have ended are left out after every surface: few go on for long.

    Parameters
    ----------
    scene : TracedScene
        What light meets.
    start : UInt32
        A label of each path.
    origin, direction : Point3f, Vector3f
        First rays.
    rng : PCG32
        Random numbers of each path.
    sun_direction : (3,) float64
        Unit vector towards the sun, above the horizon.
    max_orders, halved_after : int
        As in `collect`.

    Yields
    ------
    start, source, orders, brought : (k,) arrays
        Labels, `SUN` or `SKY`, packed orders and weighted light of the paths to which a surface,
        or the way out, brought light. At last, with None for source and orders, the labels and
        weights of the paths that were given up.
    """
    mi = scene.mi
    sun = mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in sun_direction))
    n = dr.width(start)
    orders, weight = dr.zeros(scene.word, n), dr.full(mi.Float, 1.0, n)
    for met in range(max_orders):
        thinned = dr.opaque(mi.Bool, met + 1 >= halved_after)
        brought, path = _bounce(scene, origin, direction, rng, orders, weight, sun, thinned)
        origin, direction, rng, orders, weight, alive = path
        bringing = dr.compress(brought[0] > 0)
        goes_on = dr.compress(alive)
        bring, source, met_orders, whose = (
            np.array(dr.gather(type(x), x, bringing)) for x in (*brought, start)
        )
        yield whose, source, met_orders, bring
        if not len(goes_on):
            return
        start, origin, direction, rng, orders, weight = (
            dr.gather(type(x), x, goes_on) for x in (start, origin, direction, rng, orders, weight)
        )
        dr.eval(start, origin, direction, rng, orders, weight)
    yield np.array(start), None, None, np.array(weight)


def _first_rays(mi, views: Views, view, shifts, number, rng):
    """Where paths start and whither, evenly spread over window and hemisphere."""

    def of_view(vectors):
        columns = np.ascontiguousarray(np.asarray(vectors).T, np.float32)
        return mi.Vector3f(*(dr.gather(mi.Float, mi.Float(column), view) for column in columns))

    u, v = (
        mi.Float(shift + number * mi.UInt32(step)) * 2.0**-32
        for shift, step in zip(shifts, PLASTIC_STEPS, strict=True)
    )
    origin = of_view(views.corner_m) + u * of_view(views.edge_a_m) + v * of_view(views.edge_b_m)
    direction = of_view(views.axis)
    if views.cosine:
        square = mi.Point2f(rng.next_float32(), rng.next_float32())
        direction = mi.Frame3f(direction).to_world(mi.warp.square_to_cosine_hemisphere(square))
    dr.eval(origin, direction, rng)
    return mi.Point3f(origin), mi.Vector3f(direction)


def _bounce(scene, origin, direction, rng, orders, weight, sun, thinned):
    """Follow paths to the next surface.

    Returns
    -------
    brought : tuple
        Light that arrives there or straight from the sky, its source, what it met.
    path : tuple
        Origin, direction, random numbers, orders, weight, and whether the path goes on.
    """
    mi = scene.mi
    active = dr.full(mi.Bool, True, dr.width(weight))
    point, normal, counter, hit, leaf, voxel = scene.meet(origin, direction, rng, active)
    towards = dr.dot(normal, sun)
    same_side = towards > 0
    push = dr.select(voxel, 0.0, scene.ray_offset)
    start = point + dr.select(same_side, normal, -normal) * push
    lit = hit & (same_side | leaf)
    sunlight = scene.transmittance(start, mi.Vector3f(sun), lit, coherent=False)
    sunlight *= dr.abs(towards) / sun.z
    # Light on a leaf goes either way for certain, without the chance that the factor 2 undoes.
    sunlight *= dr.select(leaf, 0.5, 1.0)
    met = orders + event(scene, counter, leaf & ~same_side)
    from_sky = ~hit & (direction.z > 0)
    brought = (
        weight * dr.select(hit, sunlight, dr.select(from_sky, 1.0, 0.0)),
        dr.select(hit, mi.UInt32(SUN), mi.UInt32(SKY)),
        dr.select(hit, met, orders),
    )
    origin, direction, transmitted = scatter(mi, scene, point, normal, leaf, voxel, rng)
    orders = orders + event(scene, counter, transmitted)
    ends = thinned & (rng.next_float32() < 0.5)
    weight = dr.select(thinned, 2 * weight, weight)
    path = (origin, direction, rng, orders, weight, hit & ~ends)
    dr.eval(*brought, *path)
    return brought, path
