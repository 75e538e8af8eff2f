"""How fast this machine is: a few seconds of work of the kinds that a run consists of."""

import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

STARTS, SEARCHES = 3, 5
"""How often a program is started, and neighbours are looked for: a few seconds in all."""
POINTS = 150_000
IMPORTS = "import numpy, pandas, scipy.spatial, xarray"


def measure(clock: Callable[[], float] = time.perf_counter) -> dict[str, float]:
    """Seconds of one start of a program and of one search for neighbours, here and now.

    Parameters
    ----------
    clock : callable
        Seconds that count: those on the clock, so that other programs on the machine do, or those
        of the processor.

    Returns
    -------
    dict
        `start_s` and `search_s`, each the median of several.
    """
    points = np.random.default_rng(1).normal(size=(POINTS, 3))
    return {
        "start_s": _median(_start, STARTS, clock),
        "search_s": _median(lambda: cKDTree(points).query(points, k=8), SEARCHES, clock),
    }


def _start() -> None:
    subprocess.run([sys.executable, "-c", IMPORTS], check=True, timeout=600)


def _median(work: Callable[[], object], n: int, clock: Callable[[], float]) -> float:
    taken = []
    for _ in range(n):
        started = clock()
        work()
        taken.append(clock() - started)
    return float(np.median(taken))
