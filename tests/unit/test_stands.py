"""Stands of virtual trees and what their voxels truly hold."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.virtual import stands

SMALL = {
    "height_m": 4.0,
    "crown_base_m": 1.2,
    "crown_radius_m": 1.0,
    "dbh_m": 0.08,
    "n_clumps": 20,
    "twigs_per_leaf_m2": 10.0,
}
PLACES = [(1.5, 1.5), (4.5, 4.5)]
SIZE_M = (6.0, 6.0, 5.0)


def small(**changes):
    return stands.grow(
        "fagus", PLACES, size_m=SIZE_M, leaf_area_index=0.3, seed=3, **(SMALL | changes)
    )


@pytest.fixture(scope="module")
def stand():
    return small()


def test_leaf_area_index_is_as_asked(stand):
    assert stand.leaf_area_index == pytest.approx(0.3, rel=1e-3)


@pytest.mark.parametrize("size_m", [0.1, 0.5])
def test_voxels_hold_all_leaves_whatever_their_size(stand, size_m):
    area = stands.area_in_voxels(stand, "leaves", size_m)
    assert area.shape == tuple(round(edge / size_m) for edge in SIZE_M)
    assert area.sum() == pytest.approx(0.3 * 36, rel=1e-3)


def test_area_is_cut_exactly_at_the_facets_of_voxels():
    area = np.zeros((2, 2, 2))
    # a unit square in z = 0.3, its centre on the edge that four voxels share, as two triangles
    corners = np.array([[0.5, 0.5, 0.3], [1.5, 0.5, 0.3], [1.5, 1.5, 0.3], [0.5, 1.5, 0.3]])
    stands._add_area(corners[[[0, 1, 2], [0, 2, 3]]], 1.0, area)
    assert area[:, :, 0] == pytest.approx(0.25)
    assert not area[:, :, 1].any()


def test_what_grows_out_of_the_box_is_left_out():
    area = np.zeros((1, 1, 1))
    stands._add_area(np.array([[[-1.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 1.0, 0.5]]]), 1.0, area)
    assert area.sum() == pytest.approx(1.0 - 0.25)


def test_copies_of_a_tree_are_turned(stand):
    copies = small(n_grown=1)
    first, second = copies.triangles("leaves")
    assert len(first) == len(second)
    shift = second - first
    assert np.ptp(shift[..., 0]) > 0.1
    assert second[..., 2] == pytest.approx(first[..., 2])


def test_a_seed_gives_one_stand_and_another_seed_another(stand):
    again = next(small().triangles("leaves"))
    assert np.array_equal(again, next(stand.triangles("leaves")))
    other = stands.grow("fagus", PLACES, size_m=SIZE_M, leaf_area_index=0.3, seed=4, **SMALL)
    assert other.turn_rad[0] != stand.turn_rad[0]


@pytest.mark.parametrize(
    ("species", "places", "size_m", "named"),
    [
        ("oak", PLACES, SIZE_M, "survey.stands"),
        ("fagus", [], SIZE_M, "survey.trees_m"),
        ("fagus", [(7.0, 1.0)], SIZE_M, "survey.trees_m"),
        ("fagus", PLACES, (6.0, 6.0, 3.0), "survey.volume_m"),
    ],
)
def test_stands_that_cannot_be_are_refused(species, places, size_m, named):
    with pytest.raises(InputError, match=named):
        stands.grow(species, places, size_m=size_m, seed=1, **SMALL)


def test_voxels_have_to_divide_the_volume(stand):
    with pytest.raises(InputError, match="voxel_size_m"):
        stands.area_in_voxels(stand, "leaves", 0.7)
