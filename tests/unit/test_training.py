import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.retrieval import training_entries

PIXEL_M = 0.5
BANDS = ("450", "560", "650", "730", "840")
SUNLIT = {"near_infrared": 4, "sunlit_nir": 0.25}


def image_of(near_infrared, others=0.1):
    near_infrared = np.asarray(near_infrared, np.float32)
    return np.stack([np.full_like(near_infrared, others)] * 4 + [near_infrared])


def means_of(image, canopy=None, cell_m=3.0, **options):
    canopy = np.ones(image.shape[1:], bool) if canopy is None else canopy
    over = training_entries.cells(image.shape[1:], pixel_m=PIXEL_M, cell_m=cell_m)
    return training_entries.aggregate(
        training_entries.chunks_of(image), canopy, over, **SUNLIT, **{"min_share": 0.02, **options}
    )


def test_cells_start_in_the_north_west_and_the_last_ones_are_cut():
    over = training_entries.cells((7, 14), pixel_m=0.5, cell_m=3.0)
    assert over.shape == (2, 3)
    assert over.pixels_per_cell == 36
    cell = over.of_pixel.reshape(7, 14)
    assert (cell[:6, :6] == 0).all()
    assert (cell[:6, 6:12] == 1).all()
    assert (cell[6, 12:] == 5).all()


def test_no_pixel_is_lost_where_its_size_is_no_exact_number():
    over = training_entries.cells((1250, 1250), pixel_m=0.04, cell_m=3.0)
    assert over.shape == (17, 17)
    assert (np.bincount(over.of_pixel).reshape(17, 17)[:16, :16] == 75**2).all()


def test_a_cell_is_the_mean_of_its_sunlit_canopy_pixels():
    near = np.full((6, 6), 0.1)
    near[:2] = 0.4
    near[0, 0] = 0.6
    canopy = np.ones((6, 6), bool)
    canopy[1, :] = False  # sunlit, but soil
    found = means_of(image_of(near), canopy)
    mean, count = found["sunlit"]
    assert count.tolist() == [[[6]]]
    assert mean[0, 4, 0, 0] == pytest.approx((5 * 0.4 + 0.6) / 6)
    mean, count = found["all"]
    assert count.tolist() == [[[30]]]
    assert mean[0, 4, 0, 0] == pytest.approx((5 * 0.4 + 0.6 + 24 * 0.1) / 30)


def test_pixels_that_are_chosen_to_look_at_are_those_that_are_averaged():
    rng = np.random.default_rng(1)
    image = rng.random((5, 12, 18)).astype(np.float32)
    image[2, 3, 4] = np.nan
    canopy = rng.random((12, 18)) < 0.7
    for mask in training_entries.MASKS:
        chosen = training_entries.select(image, canopy, mask=mask, **SUNLIT)
        mean, count = means_of(image, canopy)[mask]
        assert count.sum() == chosen.sum()
        assert mean[0, :, 0, 1] == pytest.approx(
            image[:, :6, 6:12][:, chosen[:6, 6:12]].mean(axis=1)
        )


def test_pixels_without_data_in_any_band_do_not_count():
    image = image_of(np.full((6, 6), 0.5))
    image[0, :, :3] = np.nan
    image[4, :, :3] = 0.9
    mean, count = means_of(image)["all"]
    assert count.item() == 18
    assert mean[0, 4, 0, 0] == pytest.approx(0.5)


def test_a_cell_with_too_few_pixels_has_no_mean():
    near = np.full((6, 12), 0.1)
    near[0, 0] = 0.5
    near[0, 6:8] = 0.5
    mean, _ = means_of(image_of(near), min_share=2 / 36)["sunlit"]
    assert np.isnan(mean[0, :, 0, 0]).all()
    assert np.isfinite(mean[0, :, 0, 1]).all()
    empty = means_of(image_of(np.full((6, 6), 0.1)), min_share=0.0)["sunlit"][0]
    assert np.isnan(empty).all()


def test_it_does_not_matter_in_which_chunks_images_come():
    rng = np.random.default_rng(2)
    values = rng.random((12 * 12, 3, 5)).astype(np.float32)
    over, canopy = training_entries.cells((12, 12), pixel_m=0.5), np.ones((12, 12), bool)
    whole = training_entries.aggregate(
        [(slice(0, 144), values)], canopy, over, **SUNLIT, min_share=0.02
    )
    parts = [(slice(low, low + 48), values[low : low + 48]) for low in (0, 48, 96)]
    apart = training_entries.aggregate(iter(parts), canopy, over, **SUNLIT, min_share=0.02)
    for mask in training_entries.MASKS:
        assert np.array_equal(whole[mask][0], apart[mask][0], equal_nan=True)
    with pytest.raises(InputError, match="48 pixels; expected the 144"):
        training_entries.aggregate([parts[0], parts[2]], canopy, over, **SUNLIT, min_share=0.02)


def test_entries_carry_the_leaf_and_soil_that_made_them():
    means = np.arange(2 * 5 * 1 * 2, dtype=np.float32).reshape(2, 5, 1, 2)
    means[1, :, 0, 0] = np.nan
    count = np.array([[[4, 5]], [[0, 6]]], np.int32)
    leaves = pd.DataFrame({"chlorophyll_ug_cm2": [20.0, 60.0]})
    frame = training_entries.entries(means, count, leaves, BANDS)
    assert frame["combination"].tolist() == [0, 0, 1]
    assert frame["column"].tolist() == [0, 1, 1]
    assert frame["pixels"].tolist() == [4, 5, 6]
    assert frame["chlorophyll_ug_cm2"].tolist() == [20.0, 20.0, 60.0]
    assert np.array_equal(training_entries.features(frame, BANDS)[2], means[1, :, 0, 1])


def test_some_of_many_entries_are_drawn_and_stay_in_order():
    means, count = np.ones((10, 5, 3, 3), np.float32), np.ones((10, 3, 3), np.int32)
    leaves = pd.DataFrame({"n": np.arange(10.0)})
    frame = training_entries.entries(means, count, leaves, BANDS, max_entries=40, seed=1)
    assert len(frame) == 40
    assert frame["combination"].is_monotonic_increasing
    assert frame.equals(
        training_entries.entries(means, count, leaves, BANDS, max_entries=40, seed=1)
    )
    assert not frame.equals(
        training_entries.entries(means, count, leaves, BANDS, max_entries=40, seed=2)
    )


def test_nothing_to_learn_from_is_an_error():
    leaves, dark = pd.DataFrame({"n": [1.0]}), np.full((1, 5, 2, 2), np.nan)
    with pytest.raises(InputError, match="no cell with enough canopy"):
        training_entries.entries(dark, np.zeros((1, 2, 2)), leaves, BANDS)
    with pytest.raises(InputError, match="1 images; expected 2"):
        training_entries.entries(dark, np.zeros((1, 2, 2)), pd.DataFrame({"n": [1.0, 2.0]}), BANDS)
    with pytest.raises(InputError, match="mask"):
        training_entries.select(
            image_of(np.ones((2, 2))), np.ones((2, 2), bool), mask="shaded", **SUNLIT
        )
