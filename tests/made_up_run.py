"""A run that was never computed: every file that the report shows, with numbers that are known."""

import json

import numpy as np
import pandas as pd
import xarray as xr
import yaml

from dapple.formats import meshes, netcdf
from dapple.formats.meshes import Mesh

EVIL = "<script>window.alerted = true</script>"
TIMES = pd.date_range("2023-08-10 10:00", periods=12, freq="10min")
NAMES = ["polygons", "truth"]
ERROR = {"polygons": 50.0, "truth": 0.0}
PAR_ON_GROUND = np.arange(24.0).reshape(2, 3, 4)


def leaves(n):
    """n leaves of 2 cm² each, of two triangles."""
    corners = np.array([[0, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0, 0.01, 0]])
    vertices = np.concatenate([corners + np.array([0.1 * k, 0, 1]) for k in range(n)])
    faces = np.concatenate([[[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
                            for k in range(n)]).astype(np.int32)  # fmt: skip
    return Mesh(vertices, faces, np.repeat(np.arange(n, dtype=np.int32), 2))


def write(folder, labels=("1_1", "1_10")):
    """Two reconstructions and two sensors, of which the first has an hour's third of sun."""
    labels = list(labels)
    for name, facts in _facts().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(facts)
    about_sun = {
        "sun_zenith_deg": ("time", np.linspace(50, 40, 12)),
        "sun_azimuth_deg": ("time", np.linspace(120, 150, 12)),
    }
    light = {
        "beam_normal_umol_m2_s": (("time", "band"), np.full((12, 1), 1500.0)),
        "diffuse_horizontal_umol_m2_s": (("time", "band"), np.full((12, 1), 200.0)),
    }
    _write(folder / "sky/sky.nc", about_sun | light, {"time": TIMES})
    sensors = pd.DataFrame({"sensor": labels, "x_m": [0.0, 1.0], "y_m": 0.5, "z_m": 0.1})
    sensors.to_csv(folder / "sky/sensors.csv", index=False)
    direct = np.zeros((2, 12))
    direct[0, 3:6] = 1000.0
    for name in NAMES:
        parts = {"par": direct + 100.0, "par_direct": direct}
        data = {f"{key}_umol_m2_s": (("sensor", "time"), one) for key, one in parts.items()}
        _write(folder / f"light/{name}.nc", data, {"sensor": labels, "time": TIMES})
        meshes.write_ply(folder / f"structure/{name}/leaves_0.ply", leaves(30))
        meshes.write_ply(folder / f"structure/{name}/wood.ply", leaves(3))
    on_ground = {"par_umol_m2_s": (("time", "y", "x"), PAR_ON_GROUND)}
    on_ground |= {"sun_zenith_deg": ("time", [50.0, 40]), "sun_azimuth_deg": ("time", [120.0, 150])}
    coords = {"time": TIMES[::6], "y": np.arange(3) + 0.5, "x": np.arange(4) + 0.5}
    _write(folder / "light/ground_map.nc", on_ground, coords)
    for name, table in _tables(labels).items():
        table.to_csv(folder / f"statistics/{name}.csv", index=False)
    return folder


def _facts():
    settings = {"reconstructions": NAMES, "site": {"timezone": "Europe/Berlin"}, "seed": 1}
    judged = {"state": "amber", "expected_loss": 0.5, "alarm": 0.4, "reasons": []}
    verdict = {
        "state": "amber",
        "reconstructions": {"polygons": judged},
        "with_records": True,
        "unknown": [],
    }
    return {
        "config.yaml": yaml.safe_dump(settings),
        "verdict.json": json.dumps(verdict),
        "statistics/records.json": json.dumps({"findings": []}),
        "sky/optics.json": json.dumps({"findings": []}),
    }


def _tables(labels):
    pairs = [(name, label) for name in NAMES for label in labels]
    records = [
        {"reconstruction": name, "sensor": label, "time": time.tz_localize("UTC"),
         "measured": 300.0, "simulated": 300.0 + ERROR[name], "direct": 0.0, "low": 280.0,
         "high": 410.0, "part": "reporting"}
        for name, label in pairs
        for time in TIMES
    ]  # fmt: skip
    scores = [
        {"reconstruction": name, "sensor": label, "r": 0.9, "rmse": ERROR[name], "bias": 0.0}
        for name, label in pairs
    ]
    overall = [
        {"reconstruction": name, "n": 24, "r": 0.9 + 0.05 * k, "rmse": ERROR[name], "bias": 0.0}
        for k, name in enumerate(NAMES)
    ]
    found = {"records": records, "per_sensor": scores, "overall": overall}
    return {name: pd.DataFrame(rows) for name, rows in found.items()}


def _write(path, variables, coords):
    """A dataset whose variables say what they are."""
    about = {"units": "1", "long_name": "made up"}
    named = {name: (*variable, about) for name, variable in variables.items()}
    times = netcdf.time_coordinate(coords["time"].tz_localize("UTC"))
    netcdf.write(path, xr.Dataset(named, coords | {"time": times}))
