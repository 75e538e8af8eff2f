"""What computing light costs: seconds on the clock and of all processors, part by part."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

PARTS = ("direct", "paths", "products")
"""Steps of the computation: shadow rays, counted paths, products with skies and spectra."""

Result = TypeVar("Result")


@dataclass(frozen=True)
class Cost:
    """Seconds on the clock and seconds of all processors together."""

    wall_s: float = 0.0
    cpu_s: float = 0.0

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(self.wall_s + other.wall_s, self.cpu_s + other.cpu_s)

    def __mul__(self, factor: float) -> "Cost":
        return Cost(self.wall_s * factor, self.cpu_s * factor)


def timed(work: Callable[[], Result]) -> tuple[Result, Cost]:
    """Do some work and say what it cost."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = work()
    return found, Cost(time.perf_counter() - wall, time.process_time() - cpu)


def least(costs: Iterable[Cost]) -> Cost:
    """The least wall time and the least processor time of several runs of one thing."""
    costs = list(costs)
    return Cost(min(c.wall_s for c in costs), min(c.cpu_s for c in costs))


def repeated(work: Callable[[], Result], n: int) -> tuple[Result, Cost]:
    """Do some work n times: the last result, and the least cost, as others share the machine."""
    runs = [timed(work) for _ in range(n)]
    return runs[-1][0], least(cost for _, cost in runs)
