"""Seconds and memory of the look at the input, for five million points of a plot on a slope.

    PYTHONPATH=scripts .venv/bin/python benchmarks/check.py [--points 5000000]

Prints processor seconds, wall seconds and peak memory of `check.inspection.inspect` on a LAZ file
of ground, stems and crowns; making the file does not count.
"""

import argparse
import multiprocessing
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from dapple.check import inspection
from dapple.config.settings import validate
from dapple.formats import clouds
from dapple.formats.clouds import Cloud

SIDE_M, SLOPE, TREES = 40.0, 0.03, 30


def plot(n: int, rng: np.random.Generator) -> np.ndarray:
    """Points (n, 3) of ground, trunks and round crowns [m]."""
    ground = np.column_stack([rng.uniform(0, SIDE_M, (n // 2, 2)), rng.normal(0, 0.01, n // 2)])
    foot = rng.uniform(2, SIDE_M - 2, (TREES, 2))[rng.integers(TREES, size=n - n // 2)]
    direction = rng.normal(size=(len(foot), 3))
    direction *= (
        2 * rng.random((len(foot), 1)) ** (1 / 3) / np.linalg.norm(direction, axis=1)[:, None]
    )
    trees = np.column_stack([foot, np.full(len(foot), 5.0)]) + direction
    trunk = rng.random(len(foot)) < 0.15
    turn = rng.uniform(0, 2 * np.pi, trunk.sum())
    trees[trunk, :2] = foot[trunk] + 0.12 * np.column_stack([np.cos(turn), np.sin(turn)])
    trees[trunk, 2] = rng.uniform(0, 5, trunk.sum())
    points = np.concatenate([ground, trees])
    points[:, 2] += SLOPE * points[:, 0]
    return points


def write(path: Path, n: int) -> None:
    rng = np.random.default_rng(1)
    attributes = {"Reflectance": rng.normal(-8, 3, n).astype(np.float32)}
    cloud = Cloud(plot(n, rng), np.array([5e5, 5.3e6, 200.0]), attributes)
    clouds.write(path, cloud, scale_m=1e-3)


def settings_of(path: Path) -> dict[str, Any]:
    """The configuration of a run on a cloud and no more."""
    return validate(
        {"source": "cloud", "cloud": {"path": str(path)}, "reconstructions": ["polygons"],
         "measured": {"kind": "none"}}
    ).model_dump()  # fmt: skip


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--points", type=int, default=5_000_000)
    n = arguments.parse_args().points
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plot.laz"
        maker = multiprocessing.get_context("spawn").Process(target=write, args=(path, n))
        maker.start()  # of its own, so that its memory is not counted
        maker.join()
        settings = settings_of(path)
        wall, used = time.perf_counter(), time.process_time()
        check = inspection.inspect(settings, cloud=path)
        wall, used = time.perf_counter() - wall, time.process_time() - used
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    stems = len(check["cloud"]["stems"])
    print(f"{n:,} points, {stems} stems")
    print(f"{used:.1f} s of processor time, {wall:.1f} s, {peak_gb:.2f} GB")


if __name__ == "__main__":
    main()
