"""The page on a plot's leaf chlorophyll: its first sentences, and no empty picture."""

import numpy as np
import pandas as pd
import pytest

from dapple.figures import chlorophyll_maps, style
from dapple.report import plot_report

FILES = [{"path": "a.tif", "findings": []}]
SUN = {"sun_zenith_deg": 30.0, "sun_azimuth_deg": 180.0, "told_by": "configuration"}


@pytest.fixture
def pictures(tmp_path):
    """Two of the figures, as the rule calls them."""
    nothing = pd.DataFrame({"truth_ug_cm2": [np.nan]})
    for name in ("field", "map"):
        style.save(chlorophyll_maps.field(nothing, nothing), tmp_path / f"user_{name}.png")
    return [tmp_path / f"user_{name}.png" for name in ("map", "field")]


def page(shares, tested_on, pictures):
    rows = [plot_report.retrieved({}, np.full((3, 1), 30.0), {"cells": 1, "outside_share": share})
            for share in shares]  # fmt: skip
    accuracy = pd.DataFrame({"test_set": tested_on, "seed": "ensemble", "rmse": 1.0})
    return plot_report.build(
        "user", files=FILES, sun=SUN, sky={"450": 0.2}, sky_told_by="SPECTRL2", crs="EPSG:25832",
        retrieved=pd.DataFrame(rows), usual_outside=0.001, accuracy=accuracy,
        trees=pd.DataFrame(), figures=pictures,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("shares", "said"),
    [([0.0, 0.001], ">0 % of the cells"), ([0.02, 0.31], ">By model, 2 to 31 % of the cells")],
)
def test_the_share_of_strange_cells_is_one_number_or_a_range(shares, said, pictures):
    assert said in page(shares, ["entries"], pictures).replace("> ", ">")


def test_trees_are_drawn_only_where_some_were_measured(pictures):
    caption = plot_report.CAPTIONS["field"]
    assert caption not in page([0.1], ["entries"], pictures)
    assert caption in page([0.1], ["entries", "field"], pictures)
