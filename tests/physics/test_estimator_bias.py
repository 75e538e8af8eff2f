"""Plant area by every estimator beside the exact area of leaves that were put into a cube."""

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
