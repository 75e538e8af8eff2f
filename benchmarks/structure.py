"""How long polygons and plant area density take, and how much memory.

    python benchmarks/structure.py      writes docs/data/structure.csv

Each case runs in its own process on data made here: compiled code is loaded before the clock
starts, and the peak of memory is that of the case alone, shots included. They come in chunks, as
from a file. The time of the whole process, with imports and the making of the data, is told
beside it.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parent.parent / "scripts"))

from dapple.formats.shots import Shots
from dapple.structure.polygons import reconstruct
from dapple.structure.voxel_sums import Grid
from dapple.structure.voxels import plant_area_density

DATA = Path(__file__).parents[1] / "docs" / "data"
PUBLISHED = {
    "polygons": "281 s on a machine with 24 cores (Frey et al. 2025)",
    "voxels 0.2": "188 s, 8.4 GB (AMAPVox 2.4.2, measured once elsewhere on 2 cores)",
    "voxels 1.0": "27 to 80 s (AMAPVox 2.4.2, measured once elsewhere on 2 cores)",
}
"""Times of others: constants, not measured by this script."""
N_SHOTS, CHUNK, PLOT_M = 2_000_000, 250_000, (20.0, 20.0, 12.0)


def leaf_points(n_voxels: int = 156_000, n_points: int = 1_300_000) -> np.ndarray:
    """Points in as many 5 cm voxels of a crown, in no order."""
    rng = np.random.default_rng(1)
    cell = np.stack(np.unravel_index(rng.permutation(120**3)[:n_voxels], (120,) * 3), axis=1)
    count = 1 + rng.multinomial(n_points - n_voxels, rng.dirichlet(np.ones(n_voxels)))
    points = (np.repeat(cell, count, axis=0) + rng.random((n_points, 3))) * 0.05
    return points[rng.permutation(n_points)]


def scan() -> Iterator[Shots]:
    """Shots of eight scanners around a turbid crown in firing order, up to three returns each."""
    rng = np.random.default_rng(2)
    centre, radius_m, density_m = np.array([10.0, 10.0, 6.0]), 5.0, 0.5
    for i in range(N_SHOTS // CHUNK):
        angle = i * np.pi / 4
        origin = np.array([10 + 9 * np.cos(angle), 10 + 9 * np.sin(angle), 1.6])
        azimuth, elevation = np.meshgrid(
            np.linspace(0, 2 * np.pi, 500, endpoint=False), np.linspace(-0.7, 1.5, CHUNK // 500)
        )
        azimuth, elevation = azimuth.T.ravel(), elevation.T.ravel()
        direction = np.stack(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ],
            axis=1,
        )
        along = direction @ (centre - origin)
        half = np.sqrt(np.maximum(radius_m**2 - ((centre - origin) ** 2).sum() + along**2, 0))
        ranges = np.maximum(along - half, 0)[:, None] + np.cumsum(
            rng.exponential(1 / density_m, (CHUNK, 3)), axis=1
        )
        met = ranges < (along + half)[:, None]
        met &= (half > 0)[:, None]
        blank = np.zeros(met.sum(), np.float32)
        yield Shots(
            np.broadcast_to(origin, (CHUNK, 3)).copy(),
            direction,
            np.full(CHUNK, i, np.uint16),
            np.concatenate([[0], np.cumsum(met.sum(axis=1))]),
            ranges[met],
            blank,
            blank,
            np.zeros(3),
        )


def time_polygons() -> dict[str, float]:
    """Seconds of one reconstruction in memory, and how large it is."""
    points = leaf_points()
    reconstruct(points[:100], seed=1)
    start, cpu = time.perf_counter(), time.process_time()
    mesh = reconstruct(points, seed=1)
    took = {"seconds": time.perf_counter() - start, "cpu_s": time.process_time() - cpu}
    return took | {"inputs": len(points), "outputs": mesh.n_elements}


def time_voxels(size_m: float) -> dict[str, float]:
    """Seconds of every estimator from shots in memory, and how large the grid is."""
    grid = Grid.around(np.array([[0, 0, 0], PLOT_M]), size_m)
    first = next(scan())
    plant_area_density(first, Grid(grid.corner_m, (1, 1, 1), size_m))
    chunks = list(scan())
    start, cpu = time.perf_counter(), time.process_time()
    result = plant_area_density(chunks, grid)
    took = {"seconds": time.perf_counter() - start, "cpu_s": time.process_time() - cpu}
    return took | {"inputs": result.attrs["total_shots"], "outputs": result["n_shots"].size}


def alone(case: str) -> dict[str, float | str]:
    """A case in a process of its own: also the whole process, which makes the data and compiles."""
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, __file__, "--case", case]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    whole = {
        "process_s": time.perf_counter() - begin,
        "process_cpu_s": sum(
            getattr(after, key) - getattr(before, key) for key in ("ru_utime", "ru_stime")
        ),
    }
    return {"case": case} | json.loads(done.stdout) | whole | {"published": PUBLISHED[case]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=DATA / "structure.csv")
    parser.add_argument("--case", choices=PUBLISHED, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.case:
        kind, _, size = given.case.partition(" ")
        row = time_polygons() if kind == "polygons" else time_voxels(float(size))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        print(json.dumps(row | {"peak_gb": peak}))
        return
    table = pd.DataFrame([alone(case) for case in PUBLISHED])
    table.to_csv(given.output, index=False, float_format="%.4g")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
