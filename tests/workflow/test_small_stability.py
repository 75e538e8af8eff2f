"""The stability map in small: four stressors, harmless and broken."""

import pandas as pd
import pytest
from tests.workflow.project import copy_of_project

pytestmark = pytest.mark.whole
STRESSORS = ["leaf_area", "noise_points", "scan_positions", "sensor_position"]
METHODS = {"polygons", "surfels", "voxels_0.2", "voxels_1.0", "virtual_leaves"}


@pytest.fixture(scope="module")
def stability(tmp_path_factory):
    project = copy_of_project(
        tmp_path_factory.mktemp("stability") / "dapple",
        configfile="config/stability-small.yaml",
        experiment="stability-small",
    )
    project.run()
    return project


@pytest.fixture(scope="module")
def points(stability):
    return pd.read_csv(stability.result("stability/points.csv"))


def test_points_have_the_columns_that_others_rely_on(points):
    expected = ["stressor", "level", "reconstruction", "seed", "r", "rmse_rel", "flagged"]
    assert list(points.columns)[: len(expected)] == expected
    assert sorted(points["stressor"].unique()) == STRESSORS
    assert set(points["reconstruction"]) >= METHODS


def test_every_method_meets_every_stressor_at_every_level(points):
    count = points.groupby(["stressor", "reconstruction"]).size()
    assert (count == 2).all()


def test_one_scan_position_is_worse_than_eight(points):
    polygons = points.query("stressor == 'scan_positions' and reconstruction == 'polygons'")
    r = polygons.set_index("level")["r"]
    assert r[1] < r[8]


def test_sensors_in_wrong_places_are_worse_for_every_method(points):
    moved = points[points["stressor"] == "sensor_position"].pivot(
        index="reconstruction", columns="level", values="rmse_rel"
    )
    assert (moved[moved.columns.max()] > moved[moved.columns.min()]).all()


def test_figures_and_thresholds_are_made(stability):
    assert len(pd.read_csv(stability.result("stability/thresholds.csv")))
    for name in ("map", "curves"):
        assert stability.result(f"stability/{name}.png").stat().st_size > 10_000
