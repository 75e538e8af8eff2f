import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats.rasters import Raster
from dapple.retrieval import evaluation, maps


def square(left, bottom, edge):
    right, top = left + edge, bottom + edge
    ring = [[left, bottom], [right, bottom], [right, top], [left, top], [left, bottom]]
    return {"type": "Polygon", "coordinates": [ring]}


def raster(values, left_m=100.0, top_m=200.0, pixel_m=1.0):
    values = np.asarray(values, np.float32)
    return Raster(values, left_m, top_m, pixel_m, "EPSG:25832", ("a",) * len(values))


def test_scores_of_a_shifted_prediction():
    found = evaluation.scores(np.array([10.0, 20.0, 30.0]), np.array([12.0, 22.0, 32.0]))
    assert found["n"] == 3
    assert found["rmse"] == pytest.approx(2.0)
    assert found["bias"] == pytest.approx(2.0)
    assert found["rrmse"] == pytest.approx(0.1)
    assert found["r2"] == pytest.approx(1 - 12 / 200)


def test_the_mean_of_the_truths_scores_0_and_missing_pairs_do_not_count():
    truth = np.array([1.0, 3.0, 5.0, np.nan, 7.0])
    found = evaluation.scores(truth, np.array([3.0, 3.0, 3.0, 3.0, np.nan]))
    assert found["n"] == 3
    assert found["r2"] == pytest.approx(0.0)
    assert evaluation.scores(truth[:1], truth[:1])["n"] == 1
    assert np.isnan(evaluation.scores(truth[:1], truth[:1])["r2"])
    assert evaluation.scores(truth[:0], truth[:0])["n"] == 0


def test_scores_over_seeds_come_with_their_mean_and_those_of_the_mean_prediction():
    truth = np.array([1.0, 2.0, 3.0])
    rows = evaluation.over_seeds(truth, {1: truth + 1, 2: truth - 1})
    assert [row["seed"] for row in rows] == ["1", "2", "mean", "ensemble"]
    assert [row["rmse"] for row in rows] == pytest.approx([1.0, 1.0, 1.0, 0.0])
    assert [row["bias"] for row in rows] == pytest.approx([1.0, -1.0, 0.0, 0.0])


def test_a_crown_weighs_each_cell_by_its_area_in_it():
    weights = evaluation.area_weights(
        square(102.0, 195.0, 3.0), left_m=100.0, top_m=200.0, cell_m=3.0, shape=(2, 2)
    )
    # 102 to 105 east of 100, 2 to 5 south of 200
    assert weights == pytest.approx(np.array([[1.0, 2.0], [2.0, 4.0]]))


def test_a_tree_is_the_area_weighted_mean_of_its_cells_with_data():
    values = np.array([[[10.0, 20.0], [30.0, np.nan]], [[0.0, 0.0], [3.0, 0.0]]])
    table = evaluation.trees(
        values, [square(102.0, 195.0, 3.0), square(103.0, 194.0, 3.0)], ["a", "b"],
        np.array([15.0, 40.0]), left_m=100.0, top_m=200.0, cell_m=3.0,
    )  # fmt: skip
    assert table["predicted_0"][0] == pytest.approx((10 + 2 * 20 + 2 * 30) / 5)
    assert table["predicted_1"][0] == pytest.approx(2 * 3 / 5)
    assert table["covered_share"].tolist() == pytest.approx([5 / 9, 0.0])
    assert np.isnan(table["predicted_0"][1])
    assert evaluation.scores(table["truth_ug_cm2"], table["predicted_0"])["n"] == 1


def test_crowns_that_all_lie_elsewhere_are_an_error():
    with pytest.raises(InputError, match="1 crowns, none over a pixel"):
        evaluation.trees(
            np.ones((1, 2, 2)), [square(900.0, 900.0, 3.0)], ["a"], np.array([40.0]),
            left_m=100.0, top_m=200.0, cell_m=3.0,
        )  # fmt: skip


def test_pixels_that_do_not_fit_into_others_are_averaged_by_area():
    fine = raster([[[1.0, 2.0, 3.0]] * 3], pixel_m=1.0)
    coarse = maps.resample(fine, left_m=100.0, top_m=200.0, pixel_m=1.5, shape=(2, 2))
    row = [(1.0 + 0.5 * 2.0) / 1.5, (0.5 * 2.0 + 3.0) / 1.5]
    assert coarse == pytest.approx(np.array([[row, row]]))


def test_a_shifted_grid_takes_what_lies_under_it_and_knows_nothing_beyond():
    fine = raster([[[1.0, 2.0], [3.0, np.nan]]])
    shifted = maps.resample(fine, left_m=100.0, top_m=202.0, pixel_m=2.0, shape=(2, 2))
    assert shifted[0, 1, 0] == pytest.approx(2.0)  # of the three pixels with data
    assert np.isnan(shifted[0, 0]).all()
    assert np.isnan(shifted[0, :, 1]).all()


def test_canopy_is_where_vegetation_is_high_and_known():
    heights = raster([[[0.2, 5.0], [np.nan, 2.0]]])
    on_grid = maps.sample(heights, left_m=99.5, top_m=200.0, pixel_m=0.5, shape=(4, 5))
    mask = maps.canopy(on_grid[0], min_height_m=2.0)
    assert mask.tolist() == [[False] * 3 + [True] * 2] * 4
    with pytest.raises(InputError, match="no pixel of 50 m"):
        maps.canopy(on_grid[0], min_height_m=50.0)
