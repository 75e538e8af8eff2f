"""Memory and time of a large scan: check, points to polygons, shots to voxels.

    PYTHONPATH=scripts .venv/bin/python benchmarks/scale.py [--points N ...] [--shots N ...]
        [--output FOLDER]

A plot of `check.py` with reflectance, of each size that is asked for; shots into a crown, half of
them misses, chunk by chunk as from a file, their returns told apart by a classified cloud of half
as many points. Every stage runs in a process of its own, on files as its rule does: its memory is
the largest sum over that process and the programs that it runs. With more than one size the last
rows are what a straight line through them tells for 50 million points and 100 million shots. The
table goes to `FOLDER`; rows of sizes that it has already are replaced.
"""

import argparse
import functools
import multiprocessing
import resource
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import psutil

import check
from dapple import steps
from dapple.check import inspection
from dapple.cloud import selection
from dapple.cloud.classify import classify
from dapple.cloud.clean import clean
from dapple.config.settings import Settings
from dapple.formats import clouds, json, meshes, shots
from dapple.formats.clouds import LEAF, WOOD, Cloud
from dapple.formats.shots import Shots
from dapple.structure import polygon_sizes, summary

FULL = {"voxels": 100_000_000}
FULL_POINTS = 50_000_000
CHUNK = 500_000
SETTINGS = Settings()


def make(folder: Path, n: int, name: str = "points.laz") -> None:
    """The file that the first stage which is asked for reads, as the stages before would leave it.

    Without them, leaf and wood of `classes.laz` are told by chance, voxel by voxel.
    """
    check.write(folder / name, n)
    if name == "classes.laz":
        cloud = clouds.read(folder / name)
        place = np.floor(cloud.xyz_m / SETTINGS.classify.majority_voxel_m).astype(np.int32)
        chance = (place @ np.array([73856093, 19349663, 83492791], np.int32)) & 1023
        cloud.attributes["Classification"] = np.where(chance < 700, LEAF, WOOD).astype(np.uint8)
        clouds.write(folder / name, cloud)


def checked(folder: Path, n: int) -> None:
    inspection.inspect(check.settings_of(folder / "points.laz"), cloud=folder / "points.laz")


def ingested(folder: Path, n: int) -> None:
    path = folder / "points.laz"
    cloud, _ = selection.take(*clouds.read_with_source(path), path)
    clouds.write(folder / "ingested.laz", cloud)


def cleaned(folder: Path, n: int) -> None:
    settings = SETTINGS.clean.model_dump(exclude={"distance_points"})
    cloud, counts = clean(clouds.read(folder / "ingested.laz"), **settings)
    clouds.write(folder / "clean.laz", cloud)
    json.write(folder / "clean.json", counts)


def classified(folder: Path, n: int, method: str = "auto") -> None:
    settings = dict(SETTINGS.classify) | {"method": method}
    cloud, _ = classify(clouds.read(folder / "clean.laz"), **settings, seed=1)
    clouds.write(folder / "classes.laz", cloud)


def polygons(folder: Path, n: int) -> None:
    settings = SETTINGS.polygons.model_dump()
    cloud = clouds.read(folder / "classes.laz")
    points_m, origin_m = steps.points_by_kind(cloud), cloud.origin_m
    del cloud
    made = steps.polygons_of(points_m, seed=1, **settings)
    for kind, mesh in made.items():
        meshes.write_ply(folder / f"{kind}.ply", mesh, origin_m)
    facts = summary.of_meshes(made["leaf"], made["wood"])
    del made
    leaf_m = points_m["leaf"]
    used = polygon_sizes.resolved(leaf_m, settings)
    polygon_sizes.resolved(leaf_m, settings | {"voxel_size_m": polygon_sizes.AUTO})
    polygon_sizes.bracket(leaf_m, seed=1, **used)
    json.write(folder / "summary.json", facts)


def surfels(folder: Path, n: int) -> None:
    """From the points alone: a hundred million shots, kept by direction, would take 9 GB more."""
    cloud = clouds.read(folder / "classes.laz")
    settings = SETTINGS.surfels.model_dump() | {"max_deviation": SETTINGS.clean.max_deviation}
    leaves, _ = steps.surfels(cloud, None, seed=1, **settings)
    meshes.write_ply(folder / "surfels.ply", leaves, cloud.origin_m)


def crown(folder: Path, n: int) -> None:
    """A classified cloud of points at random where the returns of `fired` are, and shots."""
    rng = np.random.default_rng(1)
    xyz_m = rng.uniform([-2, -2, 1], [2, 2, 5], (n // 2, 3))
    kinds = np.where(rng.random(n // 2) < 0.7, LEAF, WOOD).astype(np.uint8)
    clouds.write(folder / "classes.laz", Cloud(xyz_m, attributes={"Classification": kinds}))
    shots.write_chunks(folder / "shots.parquet", fired(n))


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


def voxels(folder: Path, n: int) -> None:
    cloud = clouds.read(folder / "classes.laz")
    kinds = steps.return_kinds(cloud, SETTINGS.classify.majority_voxel_m)
    settings = SETTINGS.voxels.model_dump(exclude={"sizes_m"})
    steps.voxels(shots.iterate(folder / "shots.parquet"), cloud, 0.2, kinds=kinds, **settings)


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
    sums = [0.0]
    watch = threading.Thread(target=_watched, args=(process.pid, sums))
    watch.start()
    found: dict[str, float] = receiver.recv()
    process.join()
    watch.join()
    return found | {"peak_gb": max(found["peak_gb"], max(sums) / 1e9)}


def _watched(pid: int, sums: list[float]) -> None:
    """Add up the memory of a process and of what it started, ten times a second [bytes]."""
    try:
        process = psutil.Process(pid)
        while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
            sums.append(sum(one.memory_info().rss for one in (process, *process.children(True))))
            time.sleep(0.1)
    except psutil.NoSuchProcess:
        return


STAGES = {
    "check": checked,
    "ingest": ingested,
    "clean": cleaned,
    "classify": classified,
    "polygons": polygons,
    "surfels": surfels,
}
READ = {"clean": "ingested.laz", "classify": "clean.laz"} | dict.fromkeys(
    ("polygons", "surfels"), "classes.laz"
)
"""What stages read; those before them the points."""


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument(
        "--points", type=int, nargs="*", default=[1_250_000, 2_500_000, 5_000_000]
    )
    arguments.add_argument(
        "--shots", type=int, nargs="*", default=[2_500_000, 5_000_000, 10_000_000]
    )
    arguments.add_argument("--output", type=Path)
    arguments.add_argument("--stages", nargs="*", default=[*STAGES, "voxels"])
    arguments.add_argument("--folder", type=Path, help="keeps files on the way, to go on from them")
    options = arguments.parse_args()
    rows = []
    for made, stages, sizes in (
        (make, STAGES, options.points),
        (crown, {"voxels": voxels}, options.shots),
    ):
        asked = {name: stage for name, stage in stages.items() if name in options.stages}
        given = READ.get(next(iter(asked), ""))
        begin = functools.partial(made, name=given) if given else made
        for n in sizes if asked else ():
            with tempfile.TemporaryDirectory() as passing:
                folder = options.folder / f"{made.__name__}_{n}" if options.folder else passing
                if not Path(folder, "made").exists():
                    Path(folder).mkdir(parents=True, exist_ok=True)
                    measured(begin, Path(folder), n)
                    Path(folder, "made").touch()
                for name, stage in asked.items():
                    rows.append({"stage": name, "size": n} | measured(stage, Path(folder), n))
                    print(rows[-1], flush=True)
                    _keep(rows, options.output)


def _keep(rows: list[dict], folder: Path | None) -> None:
    """Put the rows and their fits into the one that there is."""
    table = pd.DataFrame(rows).assign(by="measured")
    path = folder / "scale.csv" if folder else None
    if path and path.exists():
        table = pd.concat([pd.read_csv(path).query("by == 'measured'"), table])
        table = table.drop_duplicates(["stage", "size"], keep="last")
    table = table.sort_values("size", kind="stable", ignore_index=True)
    for name, group in table.groupby("stage", sort=False):
        full = FULL.get(str(name), FULL_POINTS)
        if len(group) > 1 and full not in set(group["size"]):
            fitted = {
                column: np.polyval(np.polyfit(group["size"], group[column], 1), full)
                for column in ("cpu_s", "peak_gb")
            }
            table.loc[len(table)] = {"stage": name, "size": full, "by": "fit"} | fitted
    if path:
        table.to_csv(path, index=False, float_format="%.3g")


if __name__ == "__main__":
    main()
