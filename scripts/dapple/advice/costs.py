"""What computing light costs: work that is counted, and seconds, part by part.

Seconds differ from run to run and from machine to machine. What is chosen by cost is chosen by
counted work, so that the same input gives the same choice everywhere.
"""

import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from dapple.light.tensor import Transport
from dapple.light.visibility import Sunlit

PARTS = ("direct", "paths", "products")
"""Steps of the computation: shadow rays, counted paths, products with skies and spectra."""

RAY_S, SURFACE_S, PRODUCT_S = 1e-7, 4e-7, 2e-9
"""Prices of a shadow ray, of a surface on a path and of a product [s], of one core of 2023."""

Result = TypeVar("Result")


@dataclass(frozen=True)
class Cost:
    """Counted work, and what it took in this very run.

    Attributes
    ----------
    work_s : float
        Counted work times its fixed prices [s]; 0 where it was not counted.
    wall_s, cpu_s : float
        Seconds on the clock, and of all processors together.
    """

    work_s: float = 0.0
    wall_s: float = 0.0
    cpu_s: float = 0.0

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(
            self.work_s + other.work_s, self.wall_s + other.wall_s, self.cpu_s + other.cpu_s
        )

    def __mul__(self, factor: float) -> "Cost":
        return Cost(self.work_s * factor, self.wall_s * factor, self.cpu_s * factor)

    def of(self, work_s: float) -> "Cost":
        """The same seconds, with what was counted."""
        return replace(self, work_s=work_s)


def work_of_sun(found: Sunlit) -> float:
    """Work of shadow rays [s]."""
    return RAY_S * len(found.share) * float(found.n_rays.sum())


def work_of_paths(found: Transport) -> float:
    """Work of straight rays to the sky and of counted paths [s]."""
    met = float(found.count @ found.orders.sum(axis=1, dtype=np.int64))
    started = float(found.n_paths.sum()) * found.n_replicates
    cut = float(found.cut.sum()) * found.max_orders
    return RAY_S * found.sky_seen.size + SURFACE_S * (started + met + cut)


def work_of_products(found: Transport, *, n_times: int, n_bands: int) -> float:
    """Work of multiplying counts with skies and spectra [s]."""
    kinds = len(np.unique(found.counters.packed(found.orders)))
    values = found.sky_seen.size + len(found.count) + kinds * n_bands
    return PRODUCT_S * n_times * values


def timed(work: Callable[[], Result]) -> tuple[Result, Cost]:
    """Do some work and say what it cost."""
    wall, cpu = time.perf_counter(), _cpu_s()
    found = work()
    return found, Cost(0.0, time.perf_counter() - wall, _cpu_s() - cpu)


def _cpu_s() -> float:
    """Processor time of this process and of those that it started and that have ended [s]."""
    used = os.times()
    return time.process_time() + used.children_user + used.children_system


def least(costs: Iterable[Cost]) -> Cost:
    """The least wall time and the least processor time of several runs of one work."""
    costs = list(costs)
    return Cost(costs[0].work_s, min(c.wall_s for c in costs), min(c.cpu_s for c in costs))


def repeated(work: Callable[[], Result], n: int) -> tuple[Result, Cost]:
    """Do some work n times: the last result, and the least cost, as others share the machine."""
    runs = [timed(work) for _ in range(n)]
    return runs[-1][0], least(cost for _, cost in runs)
