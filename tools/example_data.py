"""Make the files of config/example: a scan, weather and records as a user would bring them.

    python tools/example_data.py

A small virtual tree is scanned from four places; its true light, with the noise and the calibration
error of a logger, stands for records. Everything is drawn from one seed.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
import yaml

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "config" / "example"
DAY = "2023-08-10"
WORLD = {
    "experiment": "example-world",
    "data_dir": str(EXAMPLE),
    "reconstructions": ["truth"],
    "plant": {
        "height_m": 3.0,
        "crown_base_m": 0.9,
        "crown_radius_m": 1.2,
        "dbh_m": 0.07,
        "leaf_area_m2": 8.0,
    },
    "scan": {"positions": 4, "radius_m": 5.0, "angular_step_deg": 0.16},
    "sensors": {"columns": 4, "rows": 3, "spacing_m": 0.6},
    "time": {"start": f"{DAY} 06:00", "end": f"{DAY} 17:00", "step_min": 10},
    "radiation": {"kind": "table", "path": "radiation.csv"},
    "light": {"check": False},
    "measured": {"kind": "none"},
}
CLOUDS = [("11:20", "11:50", 0.25), ("13:40", "14:00", 0.4), ("15:10", "15:40", 0.15)]
NOISE, CALIBRATION = 0.02, 0.02
NEAR_M = 2.5


def main() -> None:
    sys.path.insert(0, str(ROOT / "scripts"))
    EXAMPLE.mkdir(exist_ok=True)
    _weather().to_csv(EXAMPLE / "radiation.csv", index=False)
    with tempfile.TemporaryDirectory() as folder:
        world = Path(folder) / "world.yaml"
        world.write_text(yaml.safe_dump(WORLD))
        results = Path(folder) / "results" / WORLD["experiment"]
        made = [f"{results}/{name}" for name in ("light/truth.nc", "scan/points.laz")]
        command = [sys.executable, "-m", "snakemake", "-s", str(ROOT / "Snakefile"), "--cores", "2"]
        command += ["--directory", folder, "--configfile", str(world), "--"]
        subprocess.run([*command, *(name[len(folder) + 1 :] for name in made)], check=True)
        _scan(results / "scan/points.laz")
        _records(results)


def _weather() -> pd.DataFrame:
    """Global and diffuse radiation of a fair day with three clouds, every ten minutes."""
    from pvlib.location import Location

    times = pd.date_range(f"{DAY} 04:00", f"{DAY} 19:00", freq="10min", tz="UTC")
    clear = Location(48.0009, 7.8003, altitude=230).get_clearsky(times, model="ineichen")
    beam = (clear["ghi"] - clear["dhi"]).clip(lower=0)
    diffuse = clear["dhi"].copy()
    for start, end, through in CLOUDS:
        covered = (times >= f"{DAY} {start}+00:00") & (times <= f"{DAY} {end}+00:00")
        diffuse[covered] += 0.35 * (1 - through) * beam[covered]
        beam[covered] *= through
    table = {"time_utc": times.strftime("%Y-%m-%d %H:%M"), "global_w_m2": (beam + diffuse).round(1)}
    return pd.DataFrame(table | {"diffuse_w_m2": diffuse.round(1)})


def _scan(points: Path) -> None:
    """The scan near the tree without its truth, and every tenth point of the ground."""
    from dapple.formats import clouds

    cloud = clouds.read(points)
    x, y, z = cloud.xyz_m.T
    kept = (np.hypot(x, y) < NEAR_M) & ((z > 0.05) | (np.arange(len(z)) % 10 == 0))
    attributes = {
        "Reflectance": cloud.attributes["Reflectance"].round(1),
        "Deviation": cloud.attributes["Deviation"].round(),
        "PointSourceId": cloud.attributes["PointSourceId"],
    }
    few = {name: values[kept] for name, values in attributes.items()}
    scan = clouds.Cloud(cloud.xyz_m[kept], cloud.origin_m, few)
    clouds.write(EXAMPLE / "tree.laz", scan, scale_m=1e-3)


def _records(results: Path) -> None:
    """Sensors, and what they would record under the true tree."""
    sensors = pd.read_csv(results / "sky/sensors.csv", dtype={"sensor": str})
    sensors.round(3).to_csv(EXAMPLE / "sensors.csv", index=False)
    light = xr.load_dataset(results / "light/truth.nc")["par_umol_m2_s"]
    rng = np.random.default_rng(1)
    factor = 1 + CALIBRATION * rng.standard_normal((light.sizes["sensor"], 1))
    recorded = light * factor * (1 + NOISE * rng.standard_normal(light.shape))
    table = recorded.round(1).to_series().rename("par_umol_m2_s").reset_index()
    table["time"] = table["time"].dt.strftime("%Y-%m-%d %H:%M")
    table = table.rename(columns={"time": "time_utc"}).sort_values(["sensor", "time_utc"])
    table.to_csv(EXAMPLE / "par.csv", index=False)


if __name__ == "__main__":
    main()
