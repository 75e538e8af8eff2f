"""The chlorophyll experiment in small: from a virtual forest to a map of leaf chlorophyll."""

import numpy as np
import pandas as pd
import pytest
from tests.workflow.project import copy_of_project

from dapple.formats import rasters

COLUMNS = {
    "accuracy.csv": "plot model mask test_set n r2 rmse rrmse",
    "speed.csv": "method combinations seconds peak_rss_mb rmse_vs_direct max_vs_direct",
}
MODELS = ["collision_orders", "prosail", "semi_less"]


@pytest.fixture(scope="module")
def chlorophyll(tmp_path_factory):
    project = copy_of_project(
        tmp_path_factory.mktemp("chlorophyll") / "dapple",
        configfile="config/chlorophyll-small.yaml",
        experiment="chlorophyll-small",
    )
    project.run()
    return project


@pytest.mark.parametrize("name", sorted(COLUMNS))
def test_tables_have_the_columns_that_others_rely_on(chlorophyll, name):
    table = pd.read_csv(chlorophyll.result(f"chlorophyll/{name}"))
    assert set(COLUMNS[name].split()) <= set(table.columns)
    assert len(table)


def test_every_model_and_mask_is_held_against_simulated_pixels_and_field_trees(chlorophyll):
    table = pd.read_csv(chlorophyll.result("chlorophyll/accuracy.csv"))
    assert sorted(table["model"].unique()) == MODELS
    assert sorted(table["mask"].unique()) == ["all", "sunlit"]
    assert {"entries", "field"} <= set(table["test_set"])
    assert table[["rmse", "rrmse"]].notna().all(axis=None)


def test_the_map_lies_where_the_images_do_and_holds_possible_values(chlorophyll):
    mapped = rasters.read(chlorophyll.result("chlorophyll/map.tif"))
    seen = rasters.read(chlorophyll.result("plots/larch/world/images.tif"))
    assert mapped.crs == seen.crs
    assert mapped.left_m == pytest.approx(seen.left_m)
    assert mapped.top_m == pytest.approx(seen.top_m)
    values = mapped.values[0][np.isfinite(mapped.values[0])]
    assert len(values) >= 10
    assert ((values >= 10) & (values <= 70)).all()


def test_collision_orders_meet_direct_renders_within_the_noise_of_both(chlorophyll):
    speed = pd.read_csv(chlorophyll.result("chlorophyll/speed.csv")).set_index("method")
    assert speed.loc["collision_orders", "rmse_vs_direct"] < 0.005


def test_all_figures_are_drawn(chlorophyll):
    for name in ("map", "field", "simulated", "spectra", "losses"):
        assert chlorophyll.result(f"chlorophyll/larch_{name}.png").stat().st_size > 5_000
