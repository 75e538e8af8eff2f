"""dapple's transport against LESS 3 on the scenes of a finished run, in turns in one process.

    python benchmarks/less3.py RUN [--results results] [--sensors N] [--times N] [--output FILE]

RUN is an experiment whose `structure/` and `sky/` lie in RESULTS. dapple computes the whole day at
all sensors, LESS a sample of sensors and times, evenly chosen, as Frey et al. (2025) do: one image
of a white plate of 3 cm for every sensor and time, 12,800 rays, all bands, a parallel sun; so
dapple's sun is a point here too. Both are run in turns, `REPEATS` times; times are the least.

Rows that are measured again are replaced in the output, others stay. `ratio` is the processor time
of LESS for the whole day (its time to build the scene, and that of the sample times the share of
the sample) at dapple's standard error, over dapple's: errors fall with the root of the number of
rays.
"""

import argparse
import contextlib
import json
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple import steps  # noqa: E402
from dapple.config.settings import Settings  # noqa: E402
from dapple.formats import netcdf, tables  # noqa: E402
from dapple.light import less_files  # noqa: E402
from dapple.light.less_files import LessRays  # noqa: E402
from dapple.light.light_model import Model, Tracing  # noqa: E402
from dapple.scene import scene_files, scene_optics, traced  # noqa: E402
from dapple.scene.scene_optics import Optics  # noqa: E402
from dapple.scene.surfaces import Scene  # noqa: E402
from dapple.sky.open_sky import open_sky_par  # noqa: E402
from dapple.sky.sky_radiance import isotropic  # noqa: E402
from dapple.workflow import evenly  # noqa: E402

REPEATS = 2
SAMPLES = {"voxels_1.0": (4, 2), "voxels_0.2": (2, 1)}
"""Sensors and times of LESS in turbid voxels, where it is slow."""
PLATE_M = 0.03
"""Diameter of the sensors, as published."""
SETTINGS = Settings(experiment="less").light


class Clock:
    """Processor and wall time since it was made [s]."""

    def __init__(self) -> None:
        self.begin = time.process_time(), time.perf_counter()

    def read(self) -> np.ndarray:
        """(2,) processor time of all threads, wall time."""
        now = time.process_time(), time.perf_counter()
        return np.subtract(now, self.begin)


def by_dapple(
    scene: Scene, sky: xr.Dataset, optics: Optics, table: pd.DataFrame
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """PAR and standard error (sensors, times), and the time that they took."""
    kept = SETTINGS.transport
    model = Model("point", kept.sky_patches, "as given", kept.max_orders, bands=len(optics))
    names = ("paths", "sky_rays", "max_shadow_rays", "tolerance", "max_growth", "sun_kernel_deg")
    tracing = replace(
        Tracing(**{name: getattr(kept, name) for name in names}),
        sun_diameter_deg=SETTINGS.sun_diameter_deg,
        aperture_m=PLATE_M,
    )
    sensors_m = table[["x_m", "y_m", "z_m"]].to_numpy()
    clock = Clock()
    loaded = traced.load(scene, "llvm_ad_mono")
    counted = steps.paths(loaded, sensors_m, model, tracing, optics=optics, seed=1)
    seen = steps.sun(loaded, sensors_m, sky, model, tracing, seed=2)
    light = steps.products(seen, counted, sky, optics, model, tracing)
    return light.par, light.standard_error, clock.read()


def by_less(
    scene: Scene, sky: xr.Dataset, optics: Optics, table: pd.DataFrame
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """PAR and standard error (sensors, times), and the times to build and to simulate."""
    import less

    from dapple.light import less_run

    rays = LessRays(
        SETTINGS.less.rays, 1, SETTINGS.transport.max_orders, sun_diameter_deg=0.0, seed=1
    )
    with tempfile.TemporaryDirectory() as name, quiet():
        folder = Path(name)
        less_files.write(folder, scene, optics, sky, table, rays, PLATE_M)
        clock = Clock()
        facts = json.loads((folder / "scene.json").read_text())
        bands, properties = less_run.properties(folder)
        built = less_run.build(folder, facts, properties)
        places = less_run.table(folder / "sensors.csv", skip=1)
        columns = {
            kind: less_run.table(folder / f"{kind}.csv", skip=1)
            for kind in ("suns", "beam", "diffuse", "sky")
        }
        built.illumination = less.Illumination(less.Sun(0.0), less.NoAtmosphere())
        built.build()
        to_build = clock.read()
        clock = Clock()
        par = np.zeros((2, len(table), len(columns["suns"])))
        for step, (angles, beam, diffuse, radiance) in enumerate(
            zip(*columns.values(), strict=True)
        ):
            light = less_run.Sky(bands, beam, diffuse, radiance.reshape(less_run.SKY_GRID))
            built.illumination = less.Illumination(less.Sun(*angles, irradiance=1.0), light)
            for number, place in enumerate(places):
                quality = round(rays.rays / less_run.PIXELS**2)
                *parts, error = less_run.seen(built, place, facts, bands, quality, rays.max_orders)
                mean, variance = less_run.mean_and_variance(sum(parts), error)
                par[:, number, step] = mean, variance**0.5
        return *par, to_build, clock.read()


@contextlib.contextmanager
def quiet():
    """Send what LESS prints, from Python and from its library, into nothing."""
    sys.stdout.flush()
    kept = os.dup(1)
    with Path(os.devnull).open("w") as nothing:
        os.dup2(nothing.fileno(), 1)
        try:
            yield
        finally:
            sys.stdout.flush()
            os.dup2(kept, 1)
            os.close(kept)


def compare(
    scene: Scene, sky: xr.Dataset, optics: Optics, table: pd.DataFrame, n: tuple[int, int]
) -> dict[str, float]:
    """One row: times, errors, agreement."""
    rows, columns = evenly(len(table), n[0]), evenly(sky.sizes["time"], n[1])
    by_dapple(scene, sky.isel(time=[0]), optics, table)  # compiles kernels
    ours, theirs = [], []
    for _ in range(REPEATS):
        ours.append(by_dapple(scene, sky, optics, table))
        theirs.append(by_less(scene, sky.isel(time=columns), optics, table.iloc[rows]))
    par, error = (values[np.ix_(rows, columns)] for values in ours[0][:2])
    less_par, less_error = theirs[0][:2]
    own = np.min([one[2] for one in ours], axis=0)
    build, simulate = (np.min([one[k] for one in theirs], axis=0) for k in (2, 3))
    day = simulate * (len(table) * sky.sizes["time"]) / (len(rows) * len(columns))
    open_sky = open_sky_par(sky.isel(time=columns)).to_numpy()
    relative = (par - less_par) / open_sky
    errors = [np.sqrt(np.mean((x / open_sky) ** 2)) for x in (error, less_error)]
    z = (par - less_par) / np.hypot(np.hypot(error, less_error), 1e-6 * open_sky)
    return {
        "sensors": len(table),
        "times": sky.sizes["time"],
        "bands": len(optics),
        "less_sensors": len(rows),
        "less_times": len(columns),
        "dapple_cpu_s": own[0],
        "dapple_wall_s": own[1],
        "less_build_cpu_s": build[0],
        "less_ms_per_run": 1e3 * simulate[0] / (len(rows) * len(columns)),
        "less_day_cpu_s": build[0] + day[0],
        "less_day_wall_s": build[1] + day[1],
        "dapple_error_rel": errors[0],
        "less_error_rel": errors[1],
        "ratio": (build[0] + day[0] * (errors[1] / errors[0]) ** 2) / own[0],
        "r": np.corrcoef(par.ravel(), less_par.ravel())[0, 1],
        "rmse_rel": np.sqrt(np.mean(relative**2)),
        "bias_rel": relative.mean(),
        "largest_difference_rel": np.abs(relative).max(),
        "max_abs_z": np.abs(z).max(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run")
    parser.add_argument("--results", type=Path, default=ROOT / "results")
    parser.add_argument("--reconstructions", nargs="+", default=["polygons", "truth"])
    parser.add_argument("--skies", nargs="+", default=["as given", "isotropic", "no sun"])
    parser.add_argument("--sensors", type=int, default=9)
    parser.add_argument("--times", type=int, default=12)
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data/less.csv")
    options = parser.parse_args()
    folder = options.results / options.run
    sky, optics = netcdf.read(folder / "sky/sky.nc"), scene_optics.read(folder / "sky/optics.nc")
    table = tables.read(folder / "sky/sensors.csv")
    found = []
    for name in options.reconstructions:
        turbid = name.startswith("voxels")
        leaves = folder / f"structure/{name}" / ("voxels.nc" if turbid else "leaves_0.ply")
        wood = folder / f"structure/{'truth' if name == 'truth' else 'polygons'}/wood.ply"
        scene = scene_files.read([str(leaves)], str(wood))[0]
        n = SAMPLES.get(name, (options.sensors, options.times))
        even = isotropic(sky)
        dark = even.assign(beam_normal_umol_m2_s=0.0 * even["beam_normal_umol_m2_s"])
        for kind, above in {"as given": sky, "isotropic": even, "no sun": dark}.items():
            if kind not in options.skies:
                continue
            row = compare(scene, above, optics, table, n)
            found.append({"run": options.run, "reconstruction": name, "sky": kind} | row)
            print(pd.Series(found[-1]).to_string(), flush=True)
    new = pd.DataFrame(found)
    if options.output.is_file():
        old = tables.read(options.output)
        keys = ["run", "reconstruction", "sky"]
        old = old[~old.set_index(keys).index.isin(new.set_index(keys).index)]
        new = pd.concat([old, new], ignore_index=True)
    tables.write(options.output, new)


if __name__ == "__main__":
    main()
