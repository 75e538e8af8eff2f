"""Trace the light of a scene once: rays and paths back from every sensor to the sky.

What comes out serves every sky, spectrum and time (`dapple.light.tensor`).
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import pandas as pd

from dapple.light.paths import Paths, trace
from dapple.light.rays_to_sky import sky_rays
from dapple.light.tensor import Transport, nominal_error, nominal_straight_error
from dapple.optics.responses import COSINE, Response
from dapple.scene.counters import Counters
from dapple.scene.scene_optics import Optics
from dapple.scene.traced import TracedScene
from dapple.sky.patches import patches
from dapple.streams import stream_seed

N_REPLICATES = 16
"""Independent sets of paths; their spread gives the standard error."""


@dataclass(frozen=True)
class Growth:
    """When more is traced than at first: where light is less certain than asked for.

    Attributes
    ----------
    tolerance : float
        Standard error under nominal skies, as a share of the open sky's light.
    largest : float
        At most so many times the rays and paths of the beginning.
    optics : Optics
        Typical ones, by which the standard error is judged.
    sun_kernel_deg : float
        See `sun_radiance`.
    """

    tolerance: float
    largest: float
    optics: Optics
    sun_kernel_deg: float


def collect(
    scene: TracedScene,
    sensors_m: np.ndarray,
    *,
    n_paths: int,
    n_patches: int,
    max_orders: int,
    seed: int,
    n_sky_rays: int = 8192,
    growth: Growth | None = None,
    halved_after: int | None = None,
    aperture_m: float = 0.0,
    response: Response = COSINE,
    facing: np.ndarray | None = None,
    keys: np.ndarray | None = None,
    n_replicates: int = N_REPLICATES,
) -> Transport:
    """Trace rays to the sky and paths from each sensor, in equal parts for every replicate.

    Parameters
    ----------
    scene : TracedScene
        What light meets.
    sensors_m : (n, 3) float64
        Places of the sensors [m].
    n_paths : int
        Of each sensor at first.
    n_patches : int
        Subdivision of the sky: 1, 145, 577, 2305.
    max_orders : int
        Most surfaces on a path, at most 255.
    seed : int
        Of the random numbers.
    n_sky_rays : int
        Straight rays to the sky of each sensor at first, at least one to a patch and replicate.
    growth : Growth or None
        When more rays and paths are traced. None: the first are enough.
    halved_after, aperture_m, response, facing, keys
        See `paths.trace`. Rays to the sky start at the middle of the aperture.
    n_replicates : int
        Independent sets, at least 2.

    Returns
    -------
    Transport
        The same for the same seed, whatever the number of threads. What is found of a sensor does
        not depend on the others.
    """
    sky = patches(n_patches)
    of_sensors: dict[str, Any] = {"response": response, "facing": facing, "keys": keys}
    of_starts: dict[str, Any] = {"facing": None, "keys": None, "response": response}
    if facing is not None:
        of_starts["facing"] = np.repeat(facing, n_replicates, axis=0)
    if keys is not None:
        of_starts["keys"] = np.add.outer(keys * n_replicates, np.arange(n_replicates)).ravel()

    def look(done: np.ndarray, wanted: np.ndarray, seen: np.ndarray | None) -> np.ndarray:
        rays = sky_rays(scene, sensors_m, sky, seed=stream_seed(seed, "sky"), **of_sensors)
        if seen is None:
            seen = np.zeros((len(sensors_m), n_replicates, sky.n), np.float32)
        for number, target in sorted({*zip(done.tolist(), wanted.tolist(), strict=True)}):
            mine = np.flatnonzero((done == number) & (wanted == target) & (wanted > done))
            if len(mine):
                more = rays(mine, n_replicates, number, target - number)
                seen[mine] = (seen[mine] * number + more) / target
        return seen

    def count(done: np.ndarray, wanted: np.ndarray, counted: Transport | None) -> Transport:
        paths = trace(
            scene,
            np.repeat(sensors_m, n_replicates, axis=0),
            np.repeat(wanted - done, n_replicates),
            first=np.repeat(done, n_replicates),
            max_orders=max_orders,
            seed=stream_seed(seed, "paths"),
            halved_after=halved_after,
            aperture_m=aperture_m,
            **of_starts,
        )
        more = _tallied(paths, scene.counters, wanted - done, seen, max_orders, response)
        return more if counted is None else _added(counted, more)

    def scattered_error(counted: Transport) -> np.ndarray:
        assert growth is not None  # only then it is asked
        return nominal_error(counted, growth.optics, sun_kernel_deg=growth.sun_kernel_deg)

    def straight_error(seen: np.ndarray) -> np.ndarray:
        return nominal_straight_error(seen, response)

    n = len(sensors_m)
    first = -(-n_sky_rays // (n_replicates * sky.n)), -(-n_paths // n_replicates)
    seen = _grown(look, straight_error, first[0], n, growth)
    return _grown(count, scattered_error, first[1], n, growth)


def _grown(
    add: Callable,
    error_of: Callable,
    first: int,
    n: int,
    growth: Growth | None,
):
    """Add samples where the error is too large, until it is not or there are enough of them."""
    done = np.full(n, first)
    found = add(np.zeros_like(done), done, None)
    while growth is not None:
        # Straight and scattered light are traced apart; their variances add.
        tolerance = growth.tolerance / np.sqrt(2)
        error = error_of(found)
        # Errors fall with the root of the samples; a fifth more, since the error is an estimate.
        needed = np.ceil(1.2 * done * (error / tolerance) ** 2 / first).astype(np.int64) * first
        wanted = np.clip(needed, done, int(growth.largest * first))
        wanted = np.where(error > tolerance, wanted, done)
        if (wanted == done).all():
            break
        found = add(done, wanted, found)
        done = wanted
    return found


def _tallied(
    paths: Paths,
    counters: Counters,
    n_paths: np.ndarray,
    seen: np.ndarray,
    max_orders: int,
    response: Response,
) -> Transport:
    """Paths of the same start, patch and orders as one row with their number."""
    _, n_replicates, n_patches = seen.shape
    scattered = paths.orders > 0
    patch = patches(n_patches).index(paths.direction[scattered])
    kind, kinds = pd.factorize(paths.orders[scattered], sort=True)
    # A path may leave a scene without ground downwards, where there is no light.
    up = patch >= 0
    place = paths.start[scattered].astype(np.int64) * n_patches + patch
    key, count = _summed((place * len(kinds) + kind)[up], paths.weight[scattered][up])
    place, kind = np.divmod(key, max(len(kinds), 1))
    start, patch = np.divmod(place, n_patches)
    sensor, replicate = np.divmod(start, n_replicates)
    return Transport(
        seen,
        sensor.astype(np.int32),
        replicate.astype(np.int32),
        patch.astype(np.int32),
        counters.unpacked(kinds)[kind],
        count,
        n_paths,
        paths.cut.reshape(-1, n_replicates).sum(axis=1),
        max_orders,
        counters,
        response,
    )


def _summed(key: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct keys in ascending order and the sum of their weights."""
    order = np.argsort(key, kind="stable")
    key = key[order]
    begin = np.flatnonzero(np.diff(key, prepend=-1))
    if not len(begin):
        return key, weight
    return key[begin], np.add.reduceat(weight[order], begin)


def _added(first: Transport, second: Transport) -> Transport:
    """Counts of both, in the order of `_tallied`."""
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("sensor", "replicate", "patch", "orders", "count")
    }
    kind, kinds = pd.factorize(first.counters.packed(columns["orders"]), sort=True)
    start = columns["sensor"].astype(np.int64) * first.n_replicates + columns["replicate"]
    key = (start * first.n_patches + columns["patch"]) * len(kinds) + kind
    _, index = np.unique(key, return_index=True)
    columns = {name: values[index] for name, values in columns.items()}
    columns["count"] = _summed(key, np.concatenate([first.count, second.count]))[1]
    same: dict[str, Any] = {
        field.name: getattr(first, field.name)
        for field in fields(Transport)
        if field.name not in columns
    }
    same |= {"n_paths": first.n_paths + second.n_paths, "cut": first.cut + second.cut}
    return Transport(**columns, **same)
