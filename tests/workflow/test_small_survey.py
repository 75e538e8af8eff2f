"""The survey of scanning designs in small: its tables, and what they have to say."""

import pandas as pd
import pytest
from tests.workflow.project import copy_of_project

COLUMNS = {
    "shadowing.csv": "stand design n_beams rs seed",
    "regression.csv": "stand design coverage_class slope r2 n",
    "profile.csv": "stand design height_m true measured angle_corrected corrected",
    "plan.csv": "stand seed planner n_scans rs expected_rs",
}
STANDS = ["fagus", "platanus"]


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    project = copy_of_project(
        tmp_path_factory.mktemp("survey") / "dapple",
        configfile="config/survey-small.yaml",
        experiment="survey-small",
    )
    project.run()
    return project


@pytest.fixture(scope="module")
def shadowing(survey):
    return pd.read_csv(survey.result("survey/shadowing.csv"))


@pytest.mark.parametrize("name", sorted(COLUMNS))
def test_tables_have_the_columns_that_others_rely_on(survey, name):
    table = pd.read_csv(survey.result(f"survey/{name}"))
    expected = COLUMNS[name].split()
    assert list(table.columns)[: len(expected)] == expected
    assert sorted(table["stand"].unique()) == STANDS


def test_every_stand_design_and_density_has_a_shadow_for_every_seed(shadowing):
    assert len(shadowing) == 2 * 2 * 2 * 2
    assert not shadowing.duplicated(["stand", "design", "n_beams", "seed"]).any()
    assert shadowing["rs"].between(0, 1).all()
    assert (shadowing["rs"] <= shadowing["not_hit"]).all()


def test_more_beams_leave_less_shadow(shadowing):
    fewest, most = (
        shadowing[shadowing["n_beams"] == n].set_index(["stand", "design", "seed"])["rs"]
        for n in (shadowing["n_beams"].min(), shadowing["n_beams"].max())
    )
    assert (most < fewest).all()


def test_every_further_scan_leaves_less_shadow(survey):
    plan = pd.read_csv(survey.result("survey/plan.csv")).sort_values("n_scans")
    for _, scans in plan.groupby(["stand", "seed", "planner"]):
        assert (scans["rs"].diff().dropna() <= 0).all()


def test_figures_are_drawn(survey):
    for name in ("shadowing", "shadow_maps", "filled_profile", "regression", "profile", "plan"):
        assert survey.result(f"survey/{name}.png").stat().st_size > 10_000
