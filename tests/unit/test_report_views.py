"""What can be explored in the report: places, light and times arrive as they were."""

import base64

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml

from dapple.formats import meshes, netcdf
from dapple.formats.meshes import Mesh
from dapple.report import ground_view, packing, residuals, run_light, sensor_view, tree_view

TIMES = pd.date_range("2023-08-10 10:00", periods=12, freq="10min")
LABELS = ["1_1", "1_10"]


def unpacked(packed):
    """What the page makes of a packed array."""
    values = np.frombuffer(base64.b64decode(packed["base64"]), "<u2")
    return values.reshape(packed["shape"])


def leaves(n):
    """n leaves of 2 cm² each, of two triangles."""
    corners = np.array([[0, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0, 0.01, 0]])
    vertices = np.concatenate([corners + np.array([0.1 * k, 0, 1]) for k in range(n)])
    faces = np.concatenate([[[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
                            for k in range(n)]).astype(np.int32)  # fmt: skip
    return Mesh(vertices, faces, np.repeat(np.arange(n, dtype=np.int32), 2))


def dataset(variables, coords):
    """A dataset whose variables say what they are."""
    about = {"units": "1", "long_name": "made up"}
    named = {name: (*variable, about) for name, variable in variables.items()}
    times = netcdf.time_coordinate(coords["time"].tz_localize("UTC"))
    return xr.Dataset(named, coords | {"time": times})


@pytest.fixture
def folder(tmp_path):
    """A run with two reconstructions, two sensors, records and a map of the ground."""
    settings = {
        "reconstructions": ["polygons", "truth"],
        "site": {"timezone": "Europe/Berlin"},
        "seed": 1,
    }
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(settings))
    sky = dataset(
        {
            "sun_zenith_deg": ("time", np.linspace(50, 40, 12)),
            "sun_azimuth_deg": ("time", np.linspace(120, 150, 12)),
            "beam_normal_umol_m2_s": (("time", "band"), np.full((12, 1), 1500.0)),
            "diffuse_horizontal_umol_m2_s": (("time", "band"), np.full((12, 1), 200.0)),
        },
        {"time": TIMES},
    )
    netcdf.write(tmp_path / "sky/sky.nc", sky)
    sensors = pd.DataFrame({"sensor": LABELS, "x_m": [0.0, 1.0], "y_m": 0.5, "z_m": 0.1})
    sensors.to_csv(tmp_path / "sky/sensors.csv", index=False)
    for name in settings["reconstructions"]:
        direct = np.zeros((2, 12))
        direct[0, 3:6] = 1000.0
        parts = {"par": direct + 100.0, "par_direct": direct}
        data = {f"{key}_umol_m2_s": (("sensor", "time"), one) for key, one in parts.items()}
        netcdf.write(
            tmp_path / f"light/{name}.nc", dataset(data, {"sensor": LABELS, "time": TIMES})
        )
    (tmp_path / "statistics").mkdir()
    rows = [
        {"reconstruction": name, "sensor": label, "time": time.tz_localize("UTC"),
         "measured": 300.0, "simulated": 300.0 + off, "direct": 0.0, "part": "reporting"}
        for name, off in (("polygons", 50.0), ("truth", 0.0))
        for label in LABELS
        for time in TIMES
    ]  # fmt: skip
    pd.DataFrame(rows).to_csv(tmp_path / "statistics/records.csv", index=False)
    scores = [(name, label, 0.9, 50.0 if name == "polygons" else 1.0, 0.0)
              for name in ("polygons", "truth") for label in LABELS]  # fmt: skip
    columns = ["reconstruction", "sensor", "r", "rmse", "bias"]
    pd.DataFrame(scores, columns=columns).to_csv(
        tmp_path / "statistics/per_sensor.csv", index=False
    )
    return tmp_path


def test_places_are_known_to_a_millimetre():
    points = np.random.default_rng(0).uniform(-8, 8, (100, 3))
    packed = packing.places(points)
    back = np.array(packed["low_m"]) + packed["step_m"] * unpacked(packed)
    assert back == pytest.approx(points, abs=0.0006)


def test_light_is_known_to_a_micromole_and_what_is_missing_stays_so():
    values = unpacked(packing.light(np.array([0.4, 1234.6, np.nan, -0.2])))
    assert values.tolist() == [0, 1235, packing.MISSING, 0]


def test_of_many_leaves_a_sample_is_drawn_with_the_area_of_all(monkeypatch, tmp_path):
    monkeypatch.setattr(tree_view, "LEAF_TRIANGLES", 20)
    meshes.write_ply(tmp_path / "structure/polygons/leaves_0.ply", leaves(100))
    chart = next(tree_view.blocks(tmp_path, ["polygons"], "polygons"))
    shown = chart.data["shown"][0]
    assert (shown["n"], shown["n_shown"]) == (100, 10)
    assert "polygons: 10 of 100" in chart.caption
    packed = shown["leaves"]["corners"]
    corners = (packed["step_m"] * unpacked(packed)).reshape(-1, 3, 3)
    edges = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum()
    assert area == pytest.approx(100 * 2e-4, rel=0.05)


def test_few_leaves_are_drawn_as_they_are(tmp_path):
    meshes.write_ply(tmp_path / "structure/polygons/leaves_0.ply", leaves(3))
    chart = next(tree_view.blocks(tmp_path, ["polygons"], "polygons"))
    assert "sample" not in chart.caption
    assert not list(tree_view.blocks(tmp_path, ["surfels"], ""))


def test_the_chart_of_sensors_has_their_series_records_and_scores_by_label(folder):
    run = run_light.read(folder)
    chart, by_reconstruction, by_sensor = sensor_view.blocks(run, folder)
    data = chart.data
    assert data["sensors"] == LABELS
    assert data["times"][0] == "2023-08-10 12:00:00"  # two hours ahead of UTC
    assert unpacked(data["simulated"]).shape == (2, 2, 12)
    assert unpacked(data["simulated"])[0, 0, 4] == 1100
    assert (unpacked(data["records"]["par"]) == 300).all()
    assert data["rmse"] == [[50.0, 50.0], [1.0, 1.0]]
    # The truth fits best, but nobody who has a scan could choose it.
    assert data["names"][data["first"]] == "polygons"
    assert [row[0].text for row in by_reconstruction.rows] == ["polygons", "truth"]
    assert [row[0].text for row in by_sensor.rows] == LABELS


def test_long_series_are_thinned_and_the_caption_says_so(folder, monkeypatch):
    monkeypatch.setattr(sensor_view, "MOST_VALUES", 24)
    chart = next(sensor_view.blocks(run_light.read(folder), folder))
    assert unpacked(chart.data["simulated"]).shape == (2, 2, 6)
    assert "Every 2th time is shown" in chart.caption


def test_residuals_are_means_of_simulated_minus_measured_by_local_hour(folder):
    by_hour, by_height = residuals.blocks(run_light.read(folder))
    bias = by_hour.data["data"][0]
    assert bias["name"] == "polygons, bias"
    assert bias["x"] == [12.5, 13.5]
    assert bias["y"] == [50.0, 50.0]
    assert bias["customdata"] == [12, 12]
    assert by_height.data["data"][0]["x"] == [42.5, 47.5, 52.5]


def test_the_slider_has_the_map_and_the_sun_of_every_stored_time(folder):
    par = np.arange(24.0).reshape(2, 3, 4)
    data = {"par_umol_m2_s": (("time", "y", "x"), par)}
    data |= {"sun_zenith_deg": ("time", [50.0, 40]), "sun_azimuth_deg": ("time", [120.0, 150])}
    coords = {"time": TIMES[::6], "y": np.arange(3) + 0.5, "x": np.arange(4) + 0.5}
    netcdf.write(folder / "light/ground_map.nc", dataset(data, coords))
    (chart,) = ground_view.blocks(run_light.read(folder), folder)
    assert unpacked(chart.data["par"]).tolist() == par.tolist()
    assert chart.data["times"] == ["2023-08-10 12:00:00", "2023-08-10 13:00:00"]
    assert chart.data["height_deg"] == [40.0, 50.0]


def test_a_run_without_light_has_none_to_show(tmp_path):
    assert run_light.read(tmp_path) is None
