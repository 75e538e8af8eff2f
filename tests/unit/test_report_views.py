"""What can be explored in the report: places, light and times arrive as they were."""

import base64
import json

import numpy as np
import pytest
from tests import made_up_run
from tests.made_up_run import leaves

from dapple.formats import meshes, netcdf
from dapple.report import ground_view, packing, residuals, run_light, sensor_view, tree_view

LABELS = ["1_1", "1_10"]


def unpacked(packed):
    """What the page makes of a packed array."""
    values = np.frombuffer(base64.b64decode(packed["base64"]), "<u2")
    return values.reshape(packed["shape"])


@pytest.fixture
def folder(tmp_path):
    """A run with two reconstructions, two sensors, records and a map of the ground."""
    return made_up_run.write(tmp_path)


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
    chart, by_reconstruction, by_sensor = sensor_view.blocks(run)
    data = chart.data
    assert data["sensors"] == LABELS
    assert data["times"][0] == "2023-08-10 12:00:00"  # two hours ahead of UTC
    assert unpacked(data["simulated"]).shape == (2, 2, 12)
    assert unpacked(data["simulated"])[0, 0, 4] == 1100
    assert (unpacked(data["records"]["par"]) == 300).all()
    assert data["rmse"] == [[50.0, 50.0], [0.0, 0.0]]
    # The truth fits best, but nobody who has a scan could choose it.
    assert data["names"][data["first"]] == "polygons"
    assert [row[0].text for row in by_reconstruction.rows] == ["polygons", "truth"]
    assert [row[0].text for row in by_sensor.rows] == LABELS


def test_the_chart_of_sensors_draws_the_predictive_interval_of_every_record(folder):
    chart = next(sensor_view.blocks(run_light.read(folder)))
    assert (unpacked(chart.data["bounds"]["low"])[0] == 280).all()
    assert (unpacked(chart.data["bounds"]["high"])[0] == 410).all()
    assert "90% of records" in chart.caption


def test_long_series_are_thinned_and_the_caption_says_so(folder, monkeypatch):
    monkeypatch.setattr(sensor_view, "MOST_VALUES", 24)
    chart = next(sensor_view.blocks(run_light.read(folder)))
    assert unpacked(chart.data["simulated"]).shape == (2, 2, 6)
    assert "Every 2th time is shown" in chart.caption


def test_residuals_are_means_of_simulated_minus_measured_by_local_hour(folder):
    by_hour, by_height = residuals.blocks(run_light.read(folder))
    bias = by_hour.data["data"][0]
    assert bias["name"] == "polygons"
    assert bias["hovertemplate"].startswith("bias")
    assert bias["x"] == [12.5, 13.5]
    assert bias["y"] == [50.0, 50.0]
    assert bias["customdata"] == [12, 12]
    assert by_height.data["data"][0]["x"] == [42.5, 47.5, 52.5]


def test_the_slider_has_the_map_and_the_sun_of_every_stored_time(folder):
    (chart,) = ground_view.blocks(run_light.read(folder), folder)
    assert unpacked(chart.data["par"]).tolist() == made_up_run.PAR_ON_GROUND.tolist()
    assert chart.data["times"] == ["2023-08-10 12:00:00", "2023-08-10 13:00:00"]
    assert chart.data["height_deg"] == [40.0, 50.0]


def test_a_run_without_light_has_none_to_show(tmp_path):
    assert run_light.read(tmp_path) is None


def test_a_night_has_a_page_too_and_what_is_not_known_is_null(folder):
    for name in ("sky/sky.nc", "light/polygons.nc", "light/truth.nc"):
        found = netcdf.read(folder / name)
        for key in found:
            if "umol" in str(key):
                found[key] = found[key] * 0 if "normal" not in str(key) else found[key].clip(max=0)
                found[key].attrs = {"units": "1", "long_name": "made up"}
        netcdf.write(folder / name, found)
    data = next(sensor_view.blocks(run_light.read(folder))).data
    assert data["flecks"] == [[None, None]] * 2
    json.loads(json.dumps(data, allow_nan=False))
