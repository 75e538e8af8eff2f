"""The trade-off: what counts as the front, and a chart that needs nothing else."""

import re

import numpy as np
import pytest

from dapple.advice import tradeoff
from dapple.figures import pareto_chart as chart
from dapple.figures import style


def row(cost, error, **facts):
    return {
        "setting": f"{cost} s",
        "reconstruction": "polygons",
        "size_m": 0.05,
        "cost_s": cost,
        "cpu_s": cost,
        "compile_s": 0.0,
        "error_rel": error,
        "error_finest_rel": error / 2,
        "reference": "truth",
        "engine": "transport",
        "sky_patches": 577,
        "max_orders": 12,
        "n_sensors": 10,
        "n_times": 36,
    } | facts


def test_names_of_ladders_that_end_low_stand_above_the_foot_of_the_axis():
    sizes_m = np.arange(1, 13) / 10
    rows = [row(1.0 + k, 0.9 - 0.07 * k, size_m=size, paths=1) for k, size in enumerate(sizes_m)]
    rows += [row(20.0, 0.01, size_m=size, paths=2) for size in sizes_m]
    figure = chart.draw(tradeoff.table(rows))
    for axes in figure.axes:
        heights = [text.xyann[1] for text in axes.texts]
        assert len(heights) == len(sizes_m)
        assert min(heights) > 0


def test_the_front_is_what_no_other_point_beats_in_both():
    rng = np.random.default_rng(1)
    cost, error = rng.random((2, 200))
    beaten = ((cost[:, None] > cost) & (error[:, None] > error)).any(axis=1)
    assert (tradeoff.front(cost, error) == ~beaten).all()


def test_of_equal_points_one_is_on_the_front_and_a_point_without_error_never():
    assert tradeoff.front([1, 1, 2], [0.1, 0.1, 0.1]).sum() == 1
    assert not tradeoff.front([0.5, 1], [np.nan, 0.1])[0]


def test_the_table_lists_the_cheapest_first_and_begins_as_others_rely_on():
    table = tradeoff.table([row(2.0, 0.1), row(1.0, 0.3), row(3.0, 0.2)])
    assert list(table.columns[:5]) == [
        "setting",
        "reconstruction",
        "cost_s",
        "error_rel",
        "on_front",
    ]
    assert list(table["cost_s"]) == [1.0, 2.0, 3.0]
    assert list(table["on_front"]) == [True, True, False]


@pytest.fixture
def points():
    rows = [row(10.0**k, 0.3 / 2**k, paths=4**k) for k in range(4)]
    rows += [row(0.5, 0.4, sky_patches=1)]
    rows += [row(9.0, 0.2, engine="timestep", sky_patches=None, paths=64)]
    rows += [row(2.0, 0.15, reconstruction="voxels_0.2", size_m=0.2)]
    return tradeoff.table(rows)


def test_the_page_is_one_file_that_asks_for_no_other(points):
    page = chart.page(points, "mine")
    assert not re.search(r"<(?:script|link|img)[^>]+(?:src|href)=.https?:", page)
    assert "Plotly.newPlot" in page
    assert "Pareto front" in page
    assert page == chart.page(points, "mine")


def test_both_charts_show_the_engines_that_this_very_run_timed_and_no_other(points):
    def names(table):
        drawn = [text.get_text() for text in chart.draw(table).axes[1].get_legend().get_texts()]
        return {name for name in chart.ENGINES.values() if name in drawn}, chart.page(table, "")

    drawn, page = names(points)
    assert drawn == {chart.ENGINES["transport"], chart.ENGINES["timestep"]}
    assert chart.ENGINES["less"] not in page
    rows = [*points.to_dict("records"), row(90.0, 0.1, engine="less", paths=800)]
    drawn, page = names(tradeoff.table(rows))
    assert drawn == set(chart.ENGINES.values())
    assert "polygons 5 cm, LESS 3" in page


def test_the_chart_has_logarithmic_axes_and_names_every_geometry(points, tmp_path):
    figure = chart.draw(points)
    for axes in figure.axes:
        assert axes.get_xscale() == axes.get_yscale() == "log"
        assert {"polygons 5 cm", "voxels 0.2 m"} <= {text.get_text() for text in axes.texts}
    style.save(figure, tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 0
