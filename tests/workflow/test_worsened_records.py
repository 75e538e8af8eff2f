"""Records of a run made worse, through the workflow, on the reconstructions of the small run."""

import pandas as pd
import pytest

pytestmark = pytest.mark.whole
AN_HOUR = (
    "time={start: 2023-08-10 10:30, end: 2023-08-10 11:30, step_min: 2}",
    "light={check: false}",
    "stability={levels: 2, seeds: 1}",
)
HARMLESS = {"clock_offset": 0.0, "sensor_position": 0.0, "few_records": 1.0, "few_sensors": 1.0}


@pytest.fixture(scope="module")
def agreement(small_run, tmp_path_factory):
    """Relative RMSE by stressor, whether it is worsened, and reconstruction."""
    project = small_run.clone(tmp_path_factory.mktemp("worsened") / "dapple")
    path = project.result("stability/records.csv")
    project.run(path.relative_to(project.folder), config=AN_HOUR)
    table = pd.read_csv(path)
    table["worsened"] = table["level"] != table["stressor"].map(HARMLESS)
    return table.set_index(["stressor", "worsened", "reconstruction"])["rmse_rel"]


def test_every_stressor_starts_from_the_undisturbed_agreement(agreement):
    undisturbed = agreement.xs(False, level="worsened").unstack("reconstruction")
    assert set(undisturbed.index) == set(HARMLESS)
    assert set(undisturbed.columns) == {"polygons", "surfels", "voxels_0.2", "voxels_1.0"}
    assert (undisturbed.nunique() == 1).all()


@pytest.mark.parametrize("stressor", ["clock_offset", "sensor_position"])
def test_wrong_clocks_and_wrong_places_cost_accuracy(agreement, stressor):
    of = agreement[stressor]
    assert of[True].mean() > 1.05 * of[False].mean()
    assert (of[True] > 0.95 * of[False]).all()  # an hour of six sensors is little to gain by luck


def test_clocks_cannot_be_worsened_where_light_is_known_once_an_hour(small_run, tmp_path):
    project = small_run.clone(tmp_path / "dapple")
    done = project.snakemake("stability_records")
    assert done.returncode != 0
    assert "time.step_min" in done.stdout
