"""Virtual conifers have the size and the needles asked for, and needles gather in shoots."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dapple.errors import InputError
from dapple.virtual import conifers
from dapple.virtual.crown_outlines import area_m2, outline

SPECIES = ("larch", "spruce")


@pytest.fixture(scope="module", params=SPECIES)
def tree(request):
    return conifers.grow(request.param, seed=3)


def reach_m(tree, low_m, high_m):
    """How far leaves between two heights stand from the stem."""
    x, y, z = tree.leaves.vertices_m.T
    return np.quantile(np.hypot(x, y)[(z > low_m) & (z < high_m)], 0.98)


def test_the_area_of_needles_is_as_asked(tree):
    assert tree.leaves.area_m2 == pytest.approx(60.0, abs=0.01)


def test_the_tree_is_as_high_and_as_wide_as_asked(tree):
    assert tree.height_m == pytest.approx(15.0, abs=0.2)
    radius_m = np.sqrt(area_m2(outline(tree.leaves.vertices_m)) / np.pi)
    assert radius_m == pytest.approx(2.5, rel=0.03)


def test_the_crown_narrows_to_the_top(tree):
    assert reach_m(tree, 12.0, 15.0) < 0.7 * reach_m(tree, 5.0, 8.0)


def test_the_stem_is_as_thick_as_asked_at_breast_height(tree):
    x, y, z = tree.wood.vertices_m.T
    below, above = ((z > low) & (z < low + 1.0) & (np.hypot(x, y) < 0.3) for low in (0.7, 1.3))
    thickness = [np.ptp(x[part]) for part in (below, above) if part.any()]
    assert min(abs(t - 0.2) for t in thickness) < 0.04


def test_needles_gather_in_shoots_and_branches(tree):
    triangles = tree.leaves.vertices_m[tree.leaves.faces].mean(axis=1)
    rng = np.random.default_rng(1)
    low, high = triangles.min(axis=0), triangles.max(axis=0)
    scattered = rng.uniform(low, high, triangles.shape)
    near = [np.median(cKDTree(p).query(p[::50], 20)[0][:, -1]) for p in (triangles, scattered)]
    assert near[0] < 0.5 * near[1]


def test_strips_face_all_ways_about_evenly(tree):
    normal = tree.leaves.triangle_normal
    up = np.abs(normal[:, 2]) / np.linalg.norm(normal, axis=1)
    assert np.average(up) == pytest.approx(0.5, abs=0.07)  # spherical angles: 0.5


def test_a_shoot_is_one_element_of_equal_strips(tree):
    assert np.bincount(tree.leaves.element).tolist() == [8] * tree.leaves.n_elements
    np.testing.assert_allclose(tree.leaves.triangle_area_m2, 0.5 * 0.16 * 0.02)


@pytest.mark.parametrize("species", SPECIES)
def test_the_seed_makes_the_tree(species):
    one, same, other = (
        conifers.grow(species, leaf_area_m2=5.0, height_m=4.0, dbh_m=0.08, seed=s)
        for s in (1, 1, 2)
    )
    assert one.leaves.vertices_m.tobytes() == same.leaves.vertices_m.tobytes()
    assert one.leaves.vertices_m.tobytes() != other.leaves.vertices_m.tobytes()


@pytest.mark.parametrize(
    "wrong",
    [{"height_m": -1.0}, {"leaf_area_m2": np.nan}, {"crown_base_share": 0.95}, {"dbh_m": 5.0}],
)
def test_impossible_sizes_are_refused(wrong):
    with pytest.raises(InputError):
        conifers.grow("larch", seed=1, **wrong)


def test_an_unknown_species_is_refused():
    with pytest.raises(InputError, match="oak"):
        conifers.grow("oak", seed=1)
