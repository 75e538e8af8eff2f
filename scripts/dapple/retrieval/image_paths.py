"""Trace the light of every pixel of an orthographic image, seen straight from above."""

from typing import Any

import drjit as dr
import numpy as np
import pandas as pd
from scipy import sparse

from dapple.errors import InputError
from dapple.light import brf
from dapple.light.paths import PLASTIC_STEPS
from dapple.progress import followed
from dapple.retrieval import basis
from dapple.retrieval.coefficients import Coefficients, Window
from dapple.scene.counters import Counters
from dapple.scene.traced import TracedScene

START_ABOVE_M = 1.0
"""Rays start so far above the highest plant."""
PILOT_PATHS = 1 << 18
"""Paths that tell which kinds of paths there are, before the functions of the kind are chosen."""


def trace(
    scene: TracedScene,
    window: Window,
    sun_direction: np.ndarray,
    *,
    n_paths: int,
    seed: int,
    n_columns: int = 32,
    max_orders: int = 100,
    halved_after: int = 48,
    n_replicates: int = 4,
    cell_m: float = 3.0,
) -> Coefficients:
    """Trace paths from every pixel and add up what they receive.

    Parameters
    ----------
    scene : TracedScene
        What light meets.
    window : Window
        The pixels, in the scene's frame.
    sun_direction : (3,) float64
        Unit vector towards the sun, above the horizon.
    n_paths : int
        Of each pixel, in equal parts for every replicate.
    seed : int
        Of the random numbers. A path depends on it, on its pixel and on its own number.
    n_columns : int
        Functions of the kind of path that are kept per pixel, for sun and sky each.
    max_orders : int
        Most surfaces on a path, at most 250.
    halved_after : int
        From this number of surfaces on every second path is ended and the other counts twice.
        Early endings make bright leaves noisy: their paths die of leaving, not of absorption.
    n_replicates : int
        Independent sets of paths, which tell the error of `cells`, at least 2.
    cell_m : float
        Edge of the cells whose error is told [m].

    Returns
    -------
    Coefficients
        The same for the same seed, whatever the number of threads.
    """
    per_set = -(-n_paths // n_replicates)
    total = per_set * n_replicates
    _check(window, sun_direction, total, max_orders)
    scene.counters.check(max_orders)
    limits = max_orders, halved_after
    kinds = _Kinds(scene.counters)
    functions = _pilot(scene, window, sun_direction, limits, n_columns, seed)
    cell, n_cells = window.cells(cell_m)
    n = len(functions)
    table = np.empty((window.n_pixels, 2 * n), np.float32)
    cells = np.zeros((n_replicates, n_cells, 2 * n))
    cut = 0.0
    step = max(1, brf.PATHS_PER_KERNEL // total)
    for low in followed(range(0, window.n_pixels, step), "paths of light from pixels"):
        high = min(low + step, window.n_pixels)
        starts = _starts(scene, window, (low, high), per_set, n_replicates, seed)
        start, kind, source, value, lost = kinds.count(
            brf.follow(scene, *starts, sun_direction, *limits)
        )
        cut += lost
        values = kinds.values(functions)
        row = 2 * (start - low * n_replicates) + source
        shape = 2 * n_replicates * (high - low), len(values)
        found = sparse.csr_array((value, (row, kind)), shape) @ values
        found = found.reshape(high - low, n_replicates, 2 * n)
        table[low:high] = found.sum(axis=1)
        here, place = np.unique(cell[low:high], return_inverse=True)
        member = sparse.csr_array((np.ones(len(place)), (place, np.arange(len(place)))))
        summed = (member @ found.reshape(high - low, -1)).reshape(len(here), n_replicates, -1)
        cells[:, here] += summed.swapaxes(0, 1)
    table /= total
    cells /= per_set * np.bincount(cell, minlength=n_cells)[:, None]
    order = np.argsort(kinds.keys, kind="stable")
    return Coefficients(
        window=window,
        table=table,
        orders=scene.counters.unpacked(kinds.keys[order]),
        values=kinds.values(functions)[order],
        light=kinds.light[:, order] / (window.n_pixels * total),
        cells=cells.astype(np.float32),
        cell_m=cell_m,
        n_paths=total,
        max_orders=max_orders,
        cut_weight=cut / (window.n_pixels * total),
        sun_cosine=float(sun_direction[2]),
        counters=scene.counters,
    )


class _Kinds:
    """The kinds of paths that were met so far, and the light that they brought."""

    def __init__(self, counters: Counters):
        self.counters = counters
        self.keys = np.empty(0, counters.word)
        self.light = np.empty((2, 0))
        self._values: np.ndarray | None = None

    def count(self, found):
        """Starts, kinds, sources and light of what paths bring, and the weight of those given up.

        Kinds are numbers of rows of `keys`, which grow.
        """
        parts, lost = [], 0.0
        for start, source, orders, brought in found:
            if source is None:
                lost = float(brought.sum())
                break
            parts.append((start.astype(np.int64), source, orders, brought.astype(np.float64)))
        start, source, orders, value = (np.concatenate(part) for part in zip(*parts, strict=True))
        place, distinct = pd.factorize(orders)
        known = pd.Index(self.keys)
        number = known.get_indexer(distinct)
        new = np.flatnonzero(number < 0)
        number[new] = len(known) + np.arange(len(new))
        self.keys = np.concatenate([self.keys, distinct[new]])
        self.light = np.pad(self.light, ((0, 0), (0, len(new))))
        kind = number[place]
        for each in (brf.SUN, brf.SKY):
            chosen = source == each
            self.light[each] += np.bincount(kind[chosen], value[chosen], len(self.keys))
        return start, kind, source, value, lost

    def values(self, functions: basis.Basis) -> np.ndarray:
        """(k, r) the functions of all kinds met so far."""
        done = 0 if self._values is None else len(self._values)
        new = functions.of(self.counters.unpacked(self.keys[done:]))
        values = new if self._values is None else np.concatenate([self._values, new])
        self._values = values
        return values


def _pilot(scene, window: Window, sun_direction, limits, n_columns: int, seed: int) -> basis.Basis:
    """Functions of the kind of path, from paths of a coarser image."""
    coarser = max(1.0, np.sqrt(window.n_pixels / 1024))
    rows, columns = (int(max(1, n // coarser)) for n in (window.rows, window.columns))
    # Not square: the whole window in pixels whose size in one direction is what is left over.
    pixel_m = min(window.rows / rows, window.columns / columns) * window.pixel_m
    coarse = Window(window.left_m, window.top_m, pixel_m, rows, columns)
    starts = _starts(
        scene, coarse, (0, coarse.n_pixels), PILOT_PATHS // coarse.n_pixels, 1, seed ^ 1
    )
    kinds = _Kinds(scene.counters)
    kinds.count(brf.follow(scene, *starts, sun_direction, *limits))
    light = kinds.light.sum(axis=0)
    order = np.argsort(kinds.keys, kind="stable")
    orders = scene.counters.unpacked(kinds.keys[order])
    return basis.fit(orders, light[order], scene.counters, n_columns, seed)


def _starts(
    scene, window: Window, pixels, per_set: int, n_replicates: int, seed: int
) -> tuple[Any, Any, Any, Any]:
    """Labels (pixel and replicate), first rays and random numbers of the paths of some pixels.

    They are spread evenly over each pixel by shifted R2 sequences.
    """
    mi = scene.mi
    index = np.arange(pixels[0] * n_replicates * per_set, pixels[1] * n_replicates * per_set)
    start = mi.UInt32((index // per_set).astype(np.uint32))
    number = mi.UInt32((index % per_set).astype(np.uint32))
    shifts = mi.sample_tea_32(start, dr.opaque(mi.UInt32, seed))
    state, sequence = mi.sample_tea_32(shifts[0] + number, shifts[1])
    rng = mi.PCG32(initstate=mi.UInt64(state), initseq=mi.UInt64(sequence))
    u, v = (
        mi.Float(shift + number * mi.UInt32(step)) * 2.0**-32
        for shift, step in zip(shifts, PLASTIC_STEPS, strict=True)
    )
    columns, replicates = (dr.opaque(mi.UInt32, n) for n in (window.columns, n_replicates))
    pixel = start // replicates
    row = pixel // columns
    column = pixel - row * columns
    left, top, size = (
        dr.opaque(mi.Float, x) for x in (window.left_m, window.top_m, window.pixel_m)
    )
    origin = mi.Point3f(
        left + (mi.Float(column) + u) * size,
        top - (mi.Float(row) + v) * size,
        scene.top_z + START_ABOVE_M,
    )
    direction = dr.zeros(mi.Vector3f, len(index))
    direction.z = -1.0
    dr.eval(start, origin, direction, rng)
    return start, origin, direction, rng


def _check(window: Window, sun_direction, n_paths: int, max_orders: int) -> None:
    if sun_direction[2] <= 0:
        raise InputError(
            "sun_direction",
            f"a sun {np.degrees(np.arcsin(sun_direction[2])):.1f} deg above the horizon",
            "a sun above the horizon",
            "Images are taken by day: check date, time zone and place.",
        )
    if not 1 <= max_orders <= 250:
        raise InputError(
            "max_orders",
            f"{max_orders}",
            "1 to 250",
            "Paths of more surfaces bring next to nothing.",
        )
    if window.n_pixels * n_paths >= 1 << 32:
        raise InputError(
            "n_paths",
            f"{n_paths} paths from each of {window.n_pixels} pixels",
            "less than 4.3e9 paths in all",
            "Take larger pixels or fewer paths.",
        )
