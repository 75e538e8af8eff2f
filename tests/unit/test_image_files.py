"""Files and comparisons of simulated images."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.retrieval import coefficient_files as files
from dapple.retrieval import comparison
from dapple.retrieval.coefficients import Coefficients, Window
from dapple.retrieval.semiless import Fitted
from dapple.scene.counters import Counters

WINDOW = Window(-2.5, 7.0, 0.5, 6, 8)


def some_coefficients():
    rng = np.random.default_rng(0)
    return Coefficients(
        window=WINDOW,
        table=rng.normal(size=(48, 6)).astype(np.float32),
        orders=rng.integers(0, 9, (5, 4)).astype(np.uint8),
        values=rng.normal(size=(5, 3)),
        light=rng.uniform(size=(2, 5)),
        cells=rng.normal(size=(4, 6, 6)).astype(np.float32),
        cell_m=1.5,
        n_paths=64,
        max_orders=100,
        cut_weight=0.0,
        sun_cosine=0.5,
        counters=Counters(("leaf",), ("wood", "ground")),
    )


def test_coefficients_come_back_as_they_were(tmp_path):
    whole = some_coefficients()
    files.write(tmp_path / "a.nc", whole)
    again = files.read(tmp_path / "a.nc")
    assert again.window == WINDOW
    assert again.counters == whole.counters
    assert (again.cell_m, again.n_paths, again.max_orders) == (1.5, 64, 100)
    for name in ("table", "orders", "values", "light", "cells"):
        one, other = getattr(again, name), getattr(whole, name)
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


def test_the_same_coefficients_give_the_same_bytes(tmp_path):
    for name in ("a.nc", "b.nc"):
        files.write(tmp_path / name, some_coefficients())
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_a_fit_comes_back_as_it_was(tmp_path):
    fitted = Fitted(WINDOW, np.ones((2, 4, 7, 48), np.float32), np.array([0.3, 0.1]))
    files.write_semiless(tmp_path / "a.nc", fitted)
    again = files.read_semiless(tmp_path / "a.nc")
    assert again.window == WINDOW
    np.testing.assert_array_equal(again.terms, fitted.terms)
    np.testing.assert_array_equal(again.diffuse_share, [0.3, 0.1])
    with pytest.raises(InputError, match="no table"):
        files.read(tmp_path / "a.nc")


def test_cells_start_in_the_north_west_and_may_be_cut():
    cell, n = WINDOW.cells(1.5)
    assert n == 2 * 3
    np.testing.assert_array_equal(cell.reshape(6, 8)[0], [0, 0, 0, 1, 1, 1, 2, 2])
    np.testing.assert_array_equal(np.bincount(cell), [9, 9, 6, 9, 9, 6])


def noisy(truth, spread, rng, n_passes=2):
    passes = truth + rng.normal(0, spread, (n_passes, 1, *truth.shape))
    return comparison.of_passes(passes, Window(0, 0, 1.0, *truth.shape), 5.0)


def test_noise_is_told_apart_from_error():
    rng = np.random.default_rng(1)
    truths = rng.uniform(size=(40, 60, 60))
    reference = comparison.together([noisy(truth, 0.1, rng) for truth in truths])
    same = comparison.together([noisy(truth, 0.1, rng) for truth in truths])
    biased = comparison.together([noisy(truth + 0.02, 0.1, rng) for truth in truths])
    table = comparison.compare(same, reference, ("840",)).set_index("scale")
    noise = 0.1 / np.sqrt(2 * 25)
    assert table.loc["cell", "noise_method"] == pytest.approx(noise, rel=0.05)
    assert table.loc["cell", "rmse"] == pytest.approx(np.sqrt(2) * noise, rel=0.05)
    assert abs(table.loc["cell", "rmse_beyond_noise"]) < 0.3 * noise
    table = comparison.compare(biased, reference, ("840",)).set_index("scale")
    assert table.loc["cell", "rmse_beyond_noise"] == pytest.approx(0.02, rel=0.05)
    assert table.loc["image", "bias"] == pytest.approx(0.02, rel=0.06)
