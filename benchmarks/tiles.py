"""Memory and light of a wide plot in tiles, beside those of the plot as a whole.

    PYTHONPATH=scripts:. .venv/bin/python benchmarks/tiles.py [--folder docs/data]

Trees 3.4 m high stand 5 m apart, each with a mesh of its own. Every row is made in a process of its
own, whose memory is counted from when it holds the meshes: `engine_mb` is what cutting and tracing
take at their peak, `process_mb` all of it. Whole and tiled plots are traced with the same rays from
the sensors, so that their light differs only where what rays meet differs.
"""

import argparse
import multiprocessing
import time
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from benchmarks import crown

from dapple import steps
from dapple.formats.meshes import Mesh, concatenate
from dapple.light import by_sensor, sun_files
from dapple.light.light_model import Model, Tracing
from dapple.light.tiles import Tiling, by_tile, triangles
from dapple.scene import traced
from dapple.scene.sensors import POSITION
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

MODEL = Model(sky_patches=145, max_orders=12, bands=4)
TRACING = Tracing(
    paths=1024, sky_rays=4640, max_shadow_rays=2048, tolerance=0.01, max_growth=1.0,
    sun_diameter_deg=SUN_DIAMETER_DEG, sun_kernel_deg=8.0,
)  # fmt: skip
SPACING_M = 5.0
SIZE = 0.5
"""Of the trees, beside the one of `crown`: so shadows end within a plot of 30 m."""
PLOTS = {30: (6.0, 24.0, 0.0, 30.0), 100: (20.0, 10.0, 40.0, 40.0)}
"""Sides of plots [m]; of their tiles [m], and down to which sun all is kept [°]; where a square of
sensors begins, and its side [m]: of a hectare, four tiles in the middle, which see most."""
TREE_TRIANGLES, FAR_TRIANGLE_M = 10_000, 0.5
WHOLE = Tiling(0.0, 10.0, FAR_TRIANGLE_M)


def plot(side_m: float, n_triangles: int) -> Scene:
    """Trees on a grid over a square, each of so many triangles of leaves."""
    leaf, stem = (
        Mesh(SIZE * mesh.vertices_m, mesh.faces, mesh.element)
        for mesh in (crown.leaves(n_triangles), crown.stem())
    )
    grid = np.arange(SPACING_M / 2, side_m, SPACING_M)
    places = np.array([(x, y, 0.0) for x in grid for y in grid])
    return Scene(of_kinds(leaf=_moved(leaf, places), wood=_moved(stem, places)))


def _moved(mesh: Mesh, places_m: np.ndarray) -> Mesh:
    return concatenate([Mesh(mesh.vertices_m + at, mesh.faces, mesh.element) for at in places_m])


def sensors(side_m: float, n_side: int, first_m: float = 0.0) -> pd.DataFrame:
    """On a grid over a square, which begins at `first_m` east and north."""
    place = first_m + (np.arange(n_side) + 0.5) / n_side * side_m
    x, y = np.meshgrid(place, place)
    table = pd.DataFrame({"x_m": x.ravel(), "y_m": y.ravel(), "z_m": 0.05})
    return table.assign(sensor=[f"s{k}" for k in range(len(table))])


def stored(scene: Scene, table: pd.DataFrame, tiling: Tiling) -> list[int]:
    """Triangles that are traced for every tile."""
    counts: list[int] = []

    def count(part: Scene, some: pd.DataFrame) -> sun_files.Suns:
        counts.append(triangles(part))
        return sun_files.Suns(*np.zeros((3, 1, len(some), 1)))

    by_tile(scene, table, tiling, 1, count)
    return counts


def light(
    scene: Scene, table: pd.DataFrame, tiling: Tiling, seed: int, sky: xr.Dataset | None = None
) -> steps.Light:
    """Direct, sky and scattered light of the sensors, by default of an afternoon."""
    optics = crown.optics(4)
    sky = crown.sky(5, 4) if sky is None else sky

    def see(part: Scene, some: pd.DataFrame) -> sun_files.Suns:
        where, loaded = some[POSITION].to_numpy(), traced.load(part, "llvm_ad_mono")
        own = {"keys": by_sensor.keys(some), "seed": seed}
        seen = steps.sun(loaded, where, sky, MODEL, TRACING, **own)
        return sun_files.Suns.from_placements([seen])

    def count(part: Scene, some: pd.DataFrame):
        where, loaded = some[POSITION].to_numpy(), traced.load(part, "llvm_ad_mono")
        own = {"keys": by_sensor.keys(some), "seed": seed}
        return steps.paths(loaded, where, MODEL, TRACING, optics=optics, **own)

    seen = by_tile(scene, table, tiling, seed, see).placements[0]
    counted = by_tile(scene, table, tiling, seed, count)
    return steps.products(seen, counted, sky, optics, MODEL, TRACING)


def memory_mb(field: str) -> float:
    """A line of the kernel's account of this process [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith(field)) / 1024


def measured(side_m: int, tiling: Tiling, seed: int) -> tuple[dict[str, float], steps.Light]:
    """What a plot takes, and its light."""
    first, side = PLOTS[side_m][2:]
    # A tiny scene first: it loads the back end and compiles the kernels.
    light(plot(SPACING_M, 100), sensors(SPACING_M, 2), WHOLE, seed=1)
    scene, table = plot(side_m, TREE_TRIANGLES), sensors(side, 10, first)
    before = memory_mb("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # forgets the peak so far
    begin = time.process_time()
    found = light(scene, table, tiling, seed)
    row = {
        "cpu_s": time.process_time() - begin,
        "engine_mb": memory_mb("VmHWM") - before,
        "process_mb": memory_mb("VmHWM"),
        "triangles": triangles(scene),
        "most_triangles": max(stored(scene, table, tiling)),
        "margin_m": tiling.margin_m(scene, table) if tiling.size_m else 0.0,
    }
    return row, found


def compared(side_m: int) -> list[dict]:
    """A plot as a whole, in tiles, and as a whole with other rays: a row each."""
    tiles = Tiling(*PLOTS[side_m][:2], FAR_TRIANGLE_M)
    rows, found = [], []
    for way, tiling, seed in (("whole", WHOLE, 1), ("tiles", tiles, 1), ("rays", WHOLE, 2)):
        with multiprocessing.get_context("spawn").Pool(1) as alone:
            row, light_of_way = alone.apply(measured, (side_m, tiling, seed))
        found.append(light_of_way)
        about = {"side_m": side_m, "way": way, "tile_m": tiling.size_m}
        rows.append(about | {"lowest_sun_deg": tiles.lowest_sun_deg} | row)
        for part in ("direct", "sky", "scattered"):
            ours, whole = getattr(light_of_way, part), getattr(found[0], part)
            rows[-1][f"{part}_difference"] = ours.mean() / whole.mean() - 1
            rows[-1][f"{part}_largest"] = np.abs(ours - whole).max() / whole.mean()
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=Path("docs/data"))
    folder = parser.parse_args().folder
    table = pd.DataFrame([row for side_m in PLOTS for row in compared(side_m)])
    table.to_csv(folder / "tiles.csv", index=False, float_format="%.5g")
    print(table.T.to_string())


if __name__ == "__main__":
    main()
