"""How time and memory grow with triangles, sensors, timesteps, both of these, days and trees.

    PYTHONPATH=scripts python benchmarks/scaling.py OUTPUT [--largest N]

Each point is a process of its own: a synthetic tree in memory, then everything from handing it to
Mitsuba to the light of all sensors and times, with a fixed number of rays. Writes `scaling.csv`,
where rows of axes that were not asked for stay, and `scaling.png`. Memory is what the engine takes
on top of the geometry that it is given.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import crown
import rays

from dapple import steps
from dapple.light.light_model import Model, Tracing
from dapple.scene import traced
from dapple.scene.surfaces import Scene
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

BASE = {"triangles": 350_000, "sensors": 72, "times": 30, "trees": 1}
AXES = {
    "triangles": (10_000, 31_623, 100_000, 316_228, 1_000_000, 3_162_278, 10_000_000),
    "sensors": (10, 32, 100, 316, 1000, 3162, 10_000),
    "times": (10, 32, 100, 316, 1000, 3162, 10_000),
    "pairs": (1000, 10_000, 100_000, 1_000_000, 10_000_000),
    "days": (4, 12, 37, 116, 365),
    "trees": (1, 10, 100, 400),
}
"""Pairs are of a sensor and a time; days have a time every ten minutes of their light."""
TIMES_A_DAY = 72
SPACING_M = 5.0
"""Of the trees of a stand: 400 stand on a hectare."""
STEPS = ("build", "direct", "paths", "bands")


def case(axis: str, value: int) -> dict[str, int]:
    """How many triangles, sensors, times and trees a point has."""
    if axis == "pairs":  # ten sensors for a time, as 10,000 sensors at 1000 times
        sensors = round(np.sqrt(10 * value))
        return BASE | {"sensors": sensors, "times": round(value / sensors)}
    return BASE | ({"times": TIMES_A_DAY * value} if axis == "days" else {axis: value})


def memory_mb(field: str) -> float:
    """A line of the kernel's account of this process, in MB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field):
            return float(line.split()[1]) / 1024
    raise ValueError(field)


def point(triangles: int, sensors: int, times: int, trees: int, variant: str) -> dict[str, float]:
    """Time and memory of one case."""
    # The first scene loads the back end and compiles the kernels.
    tiny = traced.load(crown.scene("polygons", 1000), variant)
    run(tiny, 4, 4)
    del tiny
    scene = crown.scene("polygons", triangles)
    if trees > 1:
        side = int(np.ceil(np.sqrt(trees)))
        place = np.arange(trees)
        places = SPACING_M * np.stack([place % side, place // side, 0 * place], axis=1)
        scene = Scene([replace(surface, places_m=places) for surface in scene.surfaces])
    before = memory_mb("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # forgets the peak so far
    begin = now()
    loaded = traced.load(scene, variant)
    spent = np.vstack([now() - begin, run(loaded, sensors, times)])
    engine_mb = memory_mb("VmHWM") - before
    # How many rays a second Mitsuba alone tests in this scene: the part of the growth that is its.
    bare = rays.shadow_rays(scene, variant)["bare_rays_per_s"] if trees == 1 else np.nan
    return {
        **{
            f"{step}_{kind}": x
            for step, row in zip(STEPS, spent, strict=True)
            for kind, x in zip(("s", "cpu_s"), row, strict=True)
        },
        "engine_mb": engine_mb,
        "geometry_mb": before,
        "bare_rays_per_s": bare,
    }


def now() -> np.ndarray:
    """Wall time and processor time of all threads [s]."""
    return np.array([time.perf_counter(), time.process_time()])


def run(scene: traced.TracedScene, n_sensors: int, n_times: int) -> np.ndarray:
    """Wall and processor seconds (3, 2) of shadow rays, paths, and the product with all bands."""
    sensors, sky, optics = crown.sensors(n_sensors), crown.sky(n_times), crown.optics()
    model = Model(sky_patches=577, max_orders=30, bands=len(optics))
    tracing = Tracing(
        paths=1024, sky_rays=8192, max_shadow_rays=256, tolerance=2.0,
        sun_diameter_deg=SUN_DIAMETER_DEG, sun_kernel_deg=8.0,
    )  # fmt: skip
    clock = [now()]
    sunlit = steps.sun(scene, sensors, sky, model, tracing, seed=1)
    clock.append(now())
    counted = steps.paths(scene, sensors, model, tracing, seed=2)
    clock.append(now())
    steps.products(sunlit, counted, sky, optics, model, tracing)
    clock.append(now())
    return np.diff(clock, axis=0)


def draw(table: pd.DataFrame, path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    axes_names = [name for name in AXES if (table["axis"] == name).sum() > 1]
    figure, axes = plt.subplots(
        2, len(axes_names), figsize=(3.2 * len(axes_names), 5.6), sharey="row", sharex="col",
        constrained_layout=True, squeeze=False,
    )  # fmt: skip
    labels = {
        "build": "tree for rays",
        "direct": "sun",
        "paths": "sky and paths",
        "bands": "bands",
    }
    for column, name in enumerate(axes_names):
        part = table[table["axis"] == name]
        for step in STEPS:
            axes[0, column].loglog(
                part["value"], part[f"{step}_cpu_s"], marker=".", label=labels[step]
            )
        axes[1, column].loglog(part["value"], part["engine_mb"], marker=".", color="0.3")
        axes[1, column].set_xlabel(name)
    axes[0, 0].set_ylabel("processor time [s]")
    axes[1, 0].set_ylabel("memory of the engine [MB]")
    axes[0, 0].legend(fontsize="small")
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", nargs="?", type=Path)
    parser.add_argument("--largest", type=int, default=10_000_000, help="most triangles")
    parser.add_argument("--axes", nargs="+", choices=AXES, default=list(AXES))
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--point", type=json.loads, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.point:
        print(json.dumps(point(**options.point, variant=options.variant)))
        return
    rows = []
    for name in options.axes:
        for value in AXES[name]:
            if (asked := case(name, value))["triangles"] > options.largest:
                continue
            command = [sys.executable, __file__, "--point", json.dumps(asked)]
            command += ["--variant", options.variant]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            rows.append({"axis": name, "value": value} | json.loads(done.stdout.splitlines()[-1]))
            print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.output / "scaling.csv"
    if path.exists():
        before = pd.read_csv(path)
        table = pd.concat([before[~before["axis"].isin(options.axes)], table])
    table.to_csv(path, index=False, float_format="%.4g")
    draw(table, options.output / "scaling.png")
    print(table.to_string(index=False, float_format=lambda value: f"{value:.4g}"))
    many = table[table["axis"] == "triangles"]
    if len(many) > 1:
        slope = np.polyfit(many["value"], many["engine_mb"], 1)[0] * 1024**2
        print(f"{slope:.0f} bytes a triangle")


if __name__ == "__main__":
    main()
