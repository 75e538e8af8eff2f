"""The survey of scanning designs in small: its tables, and what they have to say."""

import pandas as pd
import pytest
from tests.workflow.project import ROOT, copy_of_project

from dapple.formats import netcdf

pytestmark = pytest.mark.whole
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


def test_a_beam_takes_one_voxel_out_of_the_shadow_at_most(survey, shadowing):
    """And relative shadow counts what was passed, of which there is much."""
    for stand in STANDS:
        truth = netcdf.read(survey.result(f"survey/{stand}_1/truth.nc"))
        n_filled = int(((truth.leaf_area_m2 + truth.wood_area_m2) > 0).sum())
        rows = shadowing[(shadowing["stand"] == stand) & (shadowing["seed"] == 1)]
        assert (rows["rs"] >= 1 - rows["n_beams"] / n_filled).all()
        assert (rows["rs"] - rows["unreached"]).between(0.01, 0.2).all()


def test_shadow_is_that_of_the_published_run(shadowing):
    """Three stands differ by a standard deviation below 0.004; the same seeds give the same."""
    keys = ["stand", "design", "n_beams", "seed"]
    published = pd.read_csv(ROOT / "docs" / "data" / "survey_small_shadowing.csv")
    both = shadowing.merge(published, on=keys, suffixes=("", "_published"), validate="1:1")
    assert len(both) == len(shadowing)
    assert (both["rs"] - both["rs_published"]).abs().max() < 0.01
    assert (both["unreached"] - both["unreached_published"]).abs().max() < 0.01


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
