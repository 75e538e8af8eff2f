"""How fast is light? Transport against the per-timestep engine, on a synthetic apple tree.

    PYTHONPATH=scripts python benchmarks/light.py [--kinds polygons voxels_0.2] [--folder DIR]

For each kind of scene it prints, in one run: the time from files of geometry to a file of light in
a fresh process (72 sensors, 306 minutes, 61 bands), its standard errors, the ratio of the
per-timestep engine's time to it at equal standard error, how well both agree, and shadow rays a
second as a share of a bare loop of Mitsuba's `ray_test` over the same rays.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import crown
import rays

from dapple import steps
from dapple.formats import meshes, netcdf, voxel_grids
from dapple.light import light_datasets
from dapple.light.light_model import Model, Tracing
from dapple.light.timestep_series import Reference
from dapple.scene import scene_files, scene_optics, traced
from dapple.scene.surfaces import LEAF, WOOD, Scene
from dapple.sky.open_sky import open_beam, open_sky_par
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

TIMED = ("load", "direct", "paths", "bands_and_write")
KINDS = ("polygons", "voxels_0.2", "voxels_1.0")
KERNEL_DEG = 8.0
REFERENCE_RAYS = {
    "replicates": 16,
    "direct_rays": 64,
    "sky_rays": 64,
    "scattered_rays": 32,
    "max_depth": 8,
}


def prepare(folder: Path, kind: str, n_triangles: int, n_sensors: int, n_times: int) -> None:
    """Write the inputs of one run."""
    scene = crown.scene(kind, n_triangles)
    if scene.voxels is None:
        meshes.write_ply(folder / "leaves.ply", scene.of(LEAF)[0].mesh)
    else:
        voxel_grids.write(folder / "leaves.nc", scene.voxels)
    meshes.write_ply(folder / "wood.ply", scene.of(WOOD)[0].mesh)
    netcdf.write(folder / "sky.nc", described(crown.sky(n_times)))
    scene_optics.write(folder / "optics.nc", crown.optics())
    np.save(folder / "sensors.npy", crown.sensors(n_sensors))


def described(sky):
    """A sky dataset whose variables all say what they are."""
    for name in sky.data_vars:
        sky[name].attrs.setdefault("units", "1")
        sky[name].attrs.setdefault("long_name", name)
    return sky


def once(folder: Path, variant: str, tolerance: float) -> dict[str, float]:
    """From files of geometry to a file of light; returns seconds of each step and errors."""
    clock, cpu = [time.perf_counter()], time.process_time()
    leaves = folder / "leaves.ply"
    leaves = leaves if leaves.exists() else folder / "leaves.nc"
    scene = traced.load(scene_files.read([leaves], folder / "wood.ply")[0], variant)
    sky, optics = netcdf.read(folder / "sky.nc"), scene_optics.read(folder / "optics.nc")
    sensors = np.load(folder / "sensors.npy")
    model = Model(sky_patches=577, max_orders=30, bands=len(optics))
    tracing = Tracing(
        paths=2048,
        sky_rays=8192,
        max_shadow_rays=1 << 16,
        tolerance=tolerance,
        max_growth=64,
        sun_diameter_deg=SUN_DIAMETER_DEG,
        sun_kernel_deg=KERNEL_DEG,
    )
    clock.append(time.perf_counter())
    sunlit = steps.sun(scene, sensors, sky, model, tracing, seed=1)
    clock.append(time.perf_counter())
    counted = steps.paths(scene, sensors, model, tracing, optics=crown.optics(4), seed=2)
    clock.append(time.perf_counter())
    result = steps.products(sunlit, counted, sky, optics, model, tracing)
    names = [f"1_{k}" for k in range(len(sensors))]
    netcdf.write(folder / "light.nc", light_datasets.as_dataset(result, names, netcdf.times(sky)))
    clock.append(time.perf_counter())
    cpu = time.process_time() - cpu
    open_sky = open_sky_par(sky).to_numpy()
    share = result.standard_error / open_sky
    # As the reference engine does it: from replicates alone, nought where all rays agree.
    beam = open_beam(sky) / open_sky
    own = sunlit.share.std(axis=0, ddof=1) / np.sqrt(len(sunlit.share))
    plain = share**2 + (own**2 - sunlit.standard_error**2) * beam**2
    return dict(zip(TIMED, np.diff(clock), strict=True)) | {
        "shadow_rays": int(sunlit.n_rays.sum()) * len(sunlit.share),
        "n_paths": int(counted.n_paths.sum()) * counted.n_replicates,
        "truncated_share": float(counted.truncated_share(optics).max()),
        "error_rms": float(np.sqrt((share**2).mean())),
        "error_max": float(share.max()),
        "error_of_replicates_rms": float(np.sqrt(plain.mean())),
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "engine_cpu": cpu,
        "cpu": time.process_time(),
    }


def fresh(folder: Path, variant: str, tolerance: float) -> dict[str, float]:
    """`once` in a process of its own, imports included in `wall`."""
    begin = time.perf_counter()
    command = [sys.executable, __file__, "--once", str(folder), "--variant", variant]
    command += ["--tolerance", str(tolerance)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    wall = time.perf_counter() - begin
    return json.loads(done.stdout.splitlines()[-1]) | {"wall": wall}


def against_reference(folder: Path, scene: Scene, fast: dict, variant: str, n_compared: int):
    """Time of the per-timestep engine at equal standard error, and how far both agree."""
    sky, optics = netcdf.read(folder / "sky.nc"), scene_optics.read(folder / "optics.nc")
    sensors = pd.DataFrame(np.load(folder / "sensors.npy"), columns=["x_m", "y_m", "z_m"])
    sensors.insert(0, "sensor", [f"1_{k}" for k in range(len(sensors))])
    chosen = np.linspace(0, sky.sizes["time"] - 1, n_compared).astype(int)
    open_sky = open_sky_par(sky).to_numpy()[chosen]

    def simulate(factor: float):
        scaled = {k: round(v * factor) if "rays" in k else v for k, v in REFERENCE_RAYS.items()}
        reference = Reference(
            [scene],
            sky,
            optics,
            bands=3,
            **scaled,
            sun_diameter_deg=SUN_DIAMETER_DEG,
            aperture_m=0.0,
            variant=variant,
            seed=7,
        )
        reference.at(chosen[0], sensors)  # builds the scene and compiles the kernels
        begin, cpu = time.perf_counter(), time.process_time()
        found = [reference.at(index, sensors) for index in chosen]
        cpu = (time.process_time() - cpu) / n_compared
        seconds = (time.perf_counter() - begin) / n_compared
        par, error = (
            np.concatenate([part[name].to_numpy() for part in found], axis=1) / open_sky
            for name in ("par_umol_m2_s", "standard_error_umol_m2_s")
        )
        return seconds, cpu, par, error, (error**2).mean()

    variance = simulate(1.0)[-1]
    factor = max(variance / fast["error_of_replicates_rms"] ** 2, 1.0)
    seconds, cpu, par, error, variance = simulate(factor)
    ours = netcdf.read(folder / "light.nc").isel(time=chosen)
    difference = ours["par_umol_m2_s"].to_numpy() / open_sky - par
    mine = ours["standard_error_umol_m2_s"].to_numpy() / open_sky
    z = difference / np.hypot(np.hypot(error, mine), 1e-6)
    # What is left of the difference in variance is made up as rays at random would.
    at_equal_error = sky.sizes["time"] * variance / fast["error_of_replicates_rms"] ** 2
    engine = sum(fast[step] for step in TIMED)
    return {
        "reference_per_time": seconds,
        "reference_rays_factor": factor,
        "reference_error_rms": float(np.sqrt(variance)),
        "reference_at_equal_error": float(seconds * at_equal_error),
        "engine": engine,
        "ratio": float(seconds * at_equal_error / engine),
        "ratio_of_cpu": float(cpu * at_equal_error / fast["engine_cpu"]),
        "ratio_to_wall": float(seconds * at_equal_error / fast["wall"]),
        "rmse": float(np.sqrt((difference**2).mean())),
        "bias": float(difference.mean()),
        "max_abs_z": float(np.abs(z).max()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", default=KINDS)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--tolerance", type=float, default=0.005, help="share of the open sky")
    parser.add_argument("--triangles", type=int, default=350_000)
    parser.add_argument("--sensors", type=int, default=72)
    parser.add_argument("--times", type=int, default=306)
    parser.add_argument("--compared", type=int, default=6, help="times of the reference engine")
    parser.add_argument("--folder", type=Path, help="for light.csv; default: none is written")
    parser.add_argument("--once", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.once:
        print(json.dumps(once(options.once, options.variant, options.tolerance)))
        return
    rows = {}
    for kind in options.kinds:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            prepare(folder, kind, options.triangles, options.sensors, options.times)
            fresh(
                folder, options.variant, options.tolerance
            )  # kernels are compiled once on a machine
            row = fresh(folder, options.variant, options.tolerance)
            scene = crown.scene(kind, options.triangles)
            row |= against_reference(folder, scene, row, options.variant, options.compared)
        if kind == "polygons":
            row |= rays.shadow_rays(scene, options.variant)
            # No engine is faster than Mitsuba building its tree and testing these shadow rays.
            row["least_possible"] = row["load"] + row["shadow_rays"] / row["bare_rays_per_s"]
            row["largest_ratio"] = row["reference_at_equal_error"] / row["least_possible"]
        rows[kind] = row
    table = pd.DataFrame(rows)
    print(table.to_string(float_format=lambda value: f"{value:.4g}"))
    if options.folder:
        options.folder.mkdir(parents=True, exist_ok=True)
        table.T.rename_axis("kind").to_csv(options.folder / "light.csv")


if __name__ == "__main__":
    main()
