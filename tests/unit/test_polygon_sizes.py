"""Voxels that fit a cloud, and leaf area that is known no better than its size lets it be."""

import numpy as np
import pytest

from dapple.formats.clouds import LEAF, Cloud
from dapple.steps import polygons
from dapple.structure import polygon_sizes


def foliage(length_m, spacing_m, n_leaves=800):
    """Points by chance on flat leaves that lie any way in a crown, and their area [m²]."""
    rng = np.random.default_rng(5)
    size = np.array([length_m, 0.6 * length_m])
    centre = rng.normal(size=(n_leaves, 3))
    reach = rng.random(n_leaves) ** (1 / 3) / np.linalg.norm(centre, axis=1)
    first, other = np.moveaxis(np.linalg.qr(rng.normal(size=(n_leaves, 3, 2)))[0], 2, 0)
    on_leaf = rng.uniform(-0.5, 0.5, (n_leaves, round(size.prod() / spacing_m**2), 2)) * size
    points = (centre * reach[:, None])[:, None] + on_leaf[..., :1] * first[:, None]
    points = points + on_leaf[..., 1:] * other[:, None]
    return points.reshape(-1, 3), n_leaves * size.prod()


def test_spacings_are_those_of_a_grid_and_of_points_by_chance():
    grid = np.stack(np.meshgrid(np.arange(60) * 0.02, np.arange(60) * 0.02, [0.0]), -1)
    assert polygon_sizes.spacings_m(grid.reshape(-1, 3)) == pytest.approx((0.02, 0.02))
    chance = np.zeros((4000, 3))
    chance[:, :2] = np.random.default_rng(1).random((4000, 2))
    nearest, fourth = polygon_sizes.spacings_m(chance)
    assert nearest == pytest.approx(0.5 / np.sqrt(4000), rel=0.1)
    assert fourth == pytest.approx(1.0 / np.sqrt(4000), rel=0.15)
    assert np.isnan(polygon_sizes.spacings_m(np.zeros((5, 3)))).all()


@pytest.mark.parametrize(
    ("length_m", "spacing_m"),
    [(0.12, 0.02), (0.12, 0.03), (0.07, 0.01), (0.07, 0.02), (0.07, 0.03)],
)
def test_polygons_of_the_fitting_size_have_the_leaves_area(length_m, spacing_m):
    points, area_m2 = foliage(length_m, spacing_m)
    cloud = Cloud(points, attributes={"Classification": np.full(len(points), LEAF)})
    found = polygons(cloud, seed=1, voxel_size_m="auto", leaf_size_m=0.05)["leaf"].area_m2
    assert found == pytest.approx(area_m2, rel=0.35)
    used = polygon_sizes.resolved(points, {"voxel_size_m": "auto"})
    told = polygon_sizes.bracket(points, seed=1, **used)
    assert min(told.values()) < area_m2 < max(told.values())


def test_a_size_that_decides_the_area_is_said_with_the_one_that_fits():
    doubt = polygon_sizes.doubts({"0.05": 11.5, "0.1": 65.7, "0.2": 120.0}, "tree.laz", 0.1)
    assert "11.5 m² with 0.05 m, 65.7 m² with 0.1 m, 120 m² with 0.2 m" in doubt[0].found
    assert "0.1 m fits" in doubt[0].remedy
    assert polygon_sizes.doubts({"0.05": 8.0, "0.1": 10.0, "0.2": 12.0}, "tree.laz", 0.1) == []
