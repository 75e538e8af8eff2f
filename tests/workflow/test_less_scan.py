"""A virtual tree that LESS 3 scanned goes through the whole chain."""

from importlib.util import find_spec

import pandas as pd
import pytest

from dapple.formats import shots as shot_files

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(find_spec("less") is None, reason="less3d is not installed"),
]


def test_light_under_a_tree_scanned_by_less_follows_that_under_the_true_tree(project):
    scores = project.result("statistics/overall.csv")
    target = scores.relative_to(project.folder)
    project.run(target, config=["scan={program: less}"])
    shots = shot_files.read(project.result("scan/shots.parquet"))
    assert 0.1 < (shots.n_returns == 0).mean() < 0.95
    assert shots.n_returns.max() > 1
    found = pd.read_csv(scores).set_index("reconstruction")
    assert {"polygons", "surfels", "voxels_0.2", "voxels_1.0"} <= set(found.index)
    assert (found["r"] > 0.5).all()
