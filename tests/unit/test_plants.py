"""The virtual apple tree: its size is as asked, and its wood tapers like a tree's."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dapple.errors import InputError
from dapple.virtual import plant_skeleton
from dapple.virtual.leaf_shapes import BLADE_FORM, blades, draw_normals
from dapple.virtual.plant_tubes import Axes, of_skeleton, tubes
from dapple.virtual.plants import apple_tree

SMALL = {
    "height_m": 2.5, "crown_base_m": 0.8, "crown_radius_m": 1.0, "dbh_m": 0.06,
    "leaf_area_m2": 5.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def plant():
    return apple_tree(**SMALL, seed=1)


@pytest.fixture(scope="module")
def skeleton():
    return plant_skeleton.grow(2.5, 0.8, 1.0, 150, 20, np.random.default_rng(1))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_tree_is_as_large_as_asked(seed):
    plant = apple_tree(**SMALL, seed=seed)
    assert 2.4 < plant.height_m <= 2.5
    assert 0.8 <= plant.crown_base_m < 1.0
    assert plant.dbh_m == pytest.approx(0.06, rel=0.02)
    assert plant.crown_projection_m2 == pytest.approx(np.pi, rel=0.05)


def test_leaf_area_is_right_to_within_a_leaf_and_is_the_meshs(plant):
    assert plant.leaves.area_m2 == pytest.approx(5.0, abs=plant.leaves.element_area_m2.max())
    facts = plant.facts()
    assert facts["leaf_area_m2"] == plant.leaves.triangle_area_m2.sum()
    assert facts["wood_area_m2"] == plant.wood.triangle_area_m2.sum()
    assert facts["n_leaves"] == plant.leaves.n_elements == len(plant.leaves.faces) // 6


def test_no_leaf_or_twig_leaves_the_asked_heights(plant):
    assert plant.leaves.vertices_m[:, 2].min() >= 0.8
    assert plant.leaves.vertices_m[:, 2].max() <= 2.5
    assert plant.wood.vertices_m[:, 2].max() <= 2.5
    assert plant.wood.vertices_m[:, 2].min() == pytest.approx(0, abs=0.01)


def test_leaves_are_five_to_eight_centimetres_long(plant):
    corners = plant.leaves.vertices_m.reshape(plant.leaves.n_elements, 8, 3)
    length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    assert 0.05 <= length.min() < 0.052
    assert 0.078 < length.max() <= 0.08


def test_leaves_sit_on_shoots(plant):
    """A blade begins a petiole's length from wood."""
    base = plant.leaves.vertices_m[::8]
    distance, _ = cKDTree(plant.wood.vertices_m).query(base)
    assert distance.max() < 0.1
    assert np.median(distance) < 0.035


def test_a_seed_gives_the_same_bytes_and_another_seed_another_tree(plant):
    again, other = apple_tree(**SMALL, seed=1), apple_tree(**SMALL, seed=2)
    for one, two in ((plant.leaves, again.leaves), (plant.wood, again.wood)):
        assert one.vertices_m.tobytes() == two.vertices_m.tobytes()
        assert one.faces.tobytes() == two.faces.tobytes()
    assert plant.wood.vertices_m.shape != other.wood.vertices_m.shape


def test_spherical_leaves_show_half_their_area_from_any_side(plant):
    assert np.abs(plant.leaves.element_normal).mean(0) == pytest.approx([0.5] * 3, abs=0.03)


def test_branches_never_thicken_outwards(skeleton):
    radius = plant_skeleton.radii(skeleton, 0.06, 0.5, 0.0015)
    inner = skeleton.parent[1:]
    assert (radius[1:] <= radius[inner] * (1 + 1e-12)).all()
    assert radius[skeleton.tips] == pytest.approx(0.0015)
    assert radius[0] > 0.03


def test_parents_come_first_and_no_twig_is_grown_twice(skeleton):
    assert (skeleton.parent[1:] < np.arange(1, len(skeleton.parent))).all()
    assert len(np.unique(np.round(skeleton.xyz_m, 6), axis=0)) == len(skeleton.xyz_m)


def test_a_straight_tube_has_the_area_of_its_cylinder():
    axis = Axes(np.column_stack([np.zeros((11, 2)), np.linspace(0, 1, 11)]), np.full(11, 0.05),
                np.zeros(11, int))  # fmt: skip
    mesh = tubes(axis)
    octagon_m2 = (2 * np.pi * 0.05) ** 2 / (16 * np.tan(np.pi / 8)) / 2
    assert mesh.n_elements == 10
    assert mesh.area_m2 == pytest.approx(2 * np.pi * 0.05 + octagon_m2, rel=1e-9)


def test_bark_faces_outwards(skeleton):
    mesh = tubes(of_skeleton(skeleton, plant_skeleton.radii(skeleton, 0.06, 0.5, 0.0015)))
    middle = mesh.vertices_m[mesh.faces].mean(1)
    stem = middle[:, 2] < 0.5
    outwards = (middle[stem] * mesh.triangle_normal[stem])[:, :2].sum(1)
    assert (outwards > 0).mean() > 0.95


def test_elements_are_numbered_in_order(plant):
    for mesh in (plant.leaves, plant.wood):
        assert (np.diff(mesh.element) >= 0).all()
        assert len(np.unique(mesh.element)) == mesh.n_elements
        assert mesh.faces.max() < len(mesh.vertices_m)


def test_a_blade_has_the_area_of_its_outline_and_faces_its_normal():
    rng = np.random.default_rng(4)
    normal = draw_normals(20, "spherical", rng)
    length, width = rng.uniform(0.05, 0.08, 20), rng.uniform(0.03, 0.05, 20)
    towards = rng.normal(size=(20, 3))
    mesh = blades(np.zeros((20, 3)), towards, normal, length, width, fold_deg=20)
    assert mesh.element_area_m2 == pytest.approx(BLADE_FORM * length * width)
    assert mesh.element_normal == pytest.approx(normal, abs=1e-9)


def test_a_blade_whose_petiole_runs_along_its_normal_is_still_a_leaf():
    up = np.array([[0.0, 0.0, 1.0]])
    mesh = blades(np.zeros((1, 3)), up, up, np.array([0.06]), np.array([0.04]), fold_deg=0)
    assert mesh.area_m2 == pytest.approx(BLADE_FORM * 0.06 * 0.04)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"crown_base_m": 2.4}, "plant.crown_base_m: found 2.4 m in a tree of 2.5 m"),
        ({"dbh_m": 0.001}, "plant.dbh_m: found 0.001 m"),
        ({"leaf_area_m2": -1.0}, "plant.leaf_area_m2: found -1"),
        ({"height_m": np.nan}, "plant.height_m: found nan"),
        ({"leaf_length_min_m": 0.2}, "plant.leaf_length_min_m: found 0.2 m"),
        ({"leaf_angle_distribution": "sperical"}, "leaf_angle_distribution: found `sperical`"),
    ],
)
def test_a_size_that_no_tree_has_is_an_error(wrong, message):
    with pytest.raises(InputError, match=message):
        apple_tree(**(SMALL | wrong), seed=1)
