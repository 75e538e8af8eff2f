"""Plant area by every estimator beside the exact area of leaves that were put into a cube."""

import pandas as pd
import pytest
from benchmarks import estimators

BY_BEAMS = ("transmittance", "ppl", "fpl", "fpl_biased")


@pytest.mark.parametrize(
    ("leaf_area_index", "least", "most"), [(1.0, -0.03, 0.03), (8.0, -0.15, 0)]
)
def test_estimators_err_little_in_thin_crowns_and_miss_area_in_dense_ones(
    leaf_area_index, least, most
):
    found = estimators.biases(leaf_area_index, 0.08, 1)
    assert found["unseen"] < 0.01
    for name in BY_BEAMS:
        assert least < found[name] < most, name


def test_told_their_area_large_leaves_err_as_little_as_small_ones():
    """Eight cubes of leaves of 15 cm in voxels of 20 cm; untold, their area comes out too large."""
    found = pd.DataFrame([estimators.biases(1.0, 0.15, seed) for seed in range(1, 9)]).mean()
    assert found["fpl"] > 0.03
    assert abs(found["fpl_with_leaf_area"]) < 0.03
