"""Memory and time of a large scan: points to polygons, shots to voxels.

    PYTHONPATH=scripts .venv/bin/python benchmarks/scale.py [--points N ...] [--shots N ...]
        [--output FOLDER]

A plot of `check.py` with reflectance, of each size that is asked for; shots into a crown, half of
them misses, chunk by chunk as from a file. Every stage runs in a process of its own, on files as
its rule does, so that its peak memory is its own. The last rows are what a straight line through
the sizes tells for 50 million points and 100 million shots. The table goes to `FOLDER`.
"""

import argparse
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

import check
from dapple import steps
from dapple.cloud.classify import classify
from dapple.cloud.clean import clean
from dapple.config.settings import Settings
from dapple.formats import clouds, meshes, shots
from dapple.formats.shots import Shots

FULL = {"clean": 50e6, "classify": 50e6, "polygons": 50e6, "voxels": 100e6}
CHUNK = 500_000
SETTINGS = Settings()


def make(folder: Path, n: int) -> None:
    check.write(folder / "points.laz", n)


def cleaned(folder: Path, n: int) -> None:
    settings = SETTINGS.clean.model_dump(exclude={"distance_points"})
    cloud, _ = clean(clouds.read(folder / "points.laz"), **settings)
    clouds.write(folder / "clean.laz", cloud)


def classified(folder: Path, n: int) -> None:
    cloud, _ = classify(clouds.read(folder / "clean.laz"), **dict(SETTINGS.classify), seed=1)
    clouds.write(folder / "classes.laz", cloud)


def polygons(folder: Path, n: int) -> None:
    settings = SETTINGS.polygons.model_dump(exclude={"bracket"})
    made = steps.polygons(clouds.read(folder / "classes.laz"), seed=1, **settings)
    meshes.write_ply(folder / "leaf.ply", made["leaf"], np.zeros(3))


def fired(n: int) -> Iterator[Shots]:
    """Shots from eight places into a box of 4 m, every second without a return."""
    for start in range(0, n, CHUNK):
        rng = np.random.default_rng(start)
        size = min(CHUNK, n - start)
        scan = rng.integers(8, size=size)
        turn = 0.25 * np.pi * scan
        origin = np.column_stack([10 * np.sin(turn), 10 * np.cos(turn), np.full(size, 1.6)])
        way = rng.uniform([-2, -2, 1], [2, 2, 5], (size, 3)) - origin
        way /= np.linalg.norm(way, axis=1)[:, None]
        hit = np.arange(size) % 2 == 0
        range_m = rng.uniform(8.0, 12.0, hit.sum())
        unknown = np.full(len(range_m), np.nan, np.float32)
        first = np.concatenate([[0], np.cumsum(hit)])
        yield Shots(
            origin, way, (scan + 1).astype(np.uint16), first, range_m, unknown, unknown, np.zeros(3)
        )


def write_shots(folder: Path, n: int) -> None:
    shots.write_chunks(folder / "shots.parquet", fired(n))


def voxels(folder: Path, n: int) -> None:
    from dapple.structure.voxel_sums import Grid
    from dapple.structure.voxels import plant_area_density

    grid = Grid.around(np.array([[-2.0, -2.0, 1.0], [2.0, 2.0, 5.0]]), 0.2)
    plant_area_density(shots.iterate(folder / "shots.parquet"), grid)


def measured(stage: Callable[[Path, int], None], folder: Path, n: int) -> dict[str, float]:
    """Processor seconds, wall seconds and peak memory of a stage in a process of its own."""
    receiver, sender = multiprocessing.Pipe(duplex=False)

    def run() -> None:
        started = time.perf_counter()
        stage(folder, n)
        usage = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        sender.send(
            {
                "cpu_s": sum(one.ru_utime + one.ru_stime for one in usage),
                "wall_s": time.perf_counter() - started,
                "peak_gb": max(one.ru_maxrss for one in usage) / 1e6,
            }
        )

    process = multiprocessing.get_context("fork").Process(target=run)
    process.start()
    sender.close()
    found: dict[str, float] = receiver.recv()
    process.join()
    return found


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument(
        "--points", type=int, nargs="*", default=[1_250_000, 2_500_000, 5_000_000]
    )
    arguments.add_argument(
        "--shots", type=int, nargs="*", default=[2_500_000, 5_000_000, 10_000_000]
    )
    arguments.add_argument("--output", type=Path)
    options = arguments.parse_args()
    rows = []
    for made, stages, sizes in (
        (make, {"clean": cleaned, "classify": classified, "polygons": polygons}, options.points),
        (write_shots, {"voxels": voxels}, options.shots),
    ):
        for n in sizes:
            with tempfile.TemporaryDirectory() as folder:
                measured(made, Path(folder), n)
                for name, stage in stages.items():
                    rows.append({"stage": name, "size": n} | measured(stage, Path(folder), n))
                    print(rows[-1], flush=True)
    table = pd.DataFrame(rows).assign(by="measured")
    for name, group in table.groupby("stage", sort=False):
        if len(group) > 1:
            fitted = {
                column: np.polyval(np.polyfit(group["size"], group[column], 1), FULL[name])
                for column in ("cpu_s", "peak_gb")
            }
            table.loc[len(table)] = {"stage": name, "size": FULL[name], "by": "fit"} | fitted
    print(table.to_string(index=False))
    if options.output:
        table.to_csv(options.output / "scale.csv", index=False, float_format="%.3g")


if __name__ == "__main__":
    main()
