"""The ground under a plot, its stems, and one tree out of it."""

import numpy as np
import pytest

from dapple.cloud import ground_finder, stems, trees
from dapple.errors import InputError
from dapple.formats import ground_surface
from dapple.formats.clouds import Cloud

SLOPE = np.array([0.03, -0.01])
STEMS = np.array([[2.0, 2.0], [7.0, 3.0], [4.0, 8.0]])


def hill(xy):
    return xy @ SLOPE


def tree(at, rng, height_m=8.0):
    """A stem of 20 cm and a round crown from 3 m on, feet on the hill."""
    turn, up = rng.uniform(0, 2 * np.pi, 3000), rng.uniform(0, 5, 3000)
    stem = np.stack([0.1 * np.cos(turn), 0.1 * np.sin(turn), up], axis=1)
    crown = rng.normal(0, 1, (6000, 3))
    crown *= rng.uniform(0, 1, (6000, 1)) ** (1 / 3) / np.linalg.norm(crown, axis=1)[:, None]
    crown = crown * [1.5, 1.5, 0.5 * (height_m - 3)] + [0, 0, 0.5 * (height_m + 3)]
    points = np.concatenate([stem, crown])
    points[:, :2] += at
    points[:, 2] += hill(at)
    return points


def plot(with_ground=True, base_m=0.0, seed=1):
    """Three trees on a slope of 3 %, and which tree each point is of (0: ground)."""
    rng = np.random.default_rng(seed)
    parts = [tree(at, rng) for at in STEMS]
    label = np.repeat([1, 2, 3], [len(part) for part in parts])
    if with_ground:
        floor = rng.uniform(-1, 11, (20_000, 2))
        parts.append(np.column_stack([floor, hill(floor) + rng.normal(0, 0.01, len(floor))]))
        label = np.append(label, np.zeros(len(floor), int))
    xyz = np.concatenate(parts)
    xyz[:, 2] += base_m
    return Cloud(xyz), label


@pytest.mark.parametrize("base_m", [0.0, -1.7, 281.3])
def test_ground_on_a_slope_is_found_at_any_height(base_m):
    cloud, _ = plot(base_m=base_m)
    found = ground_finder.find(cloud)
    assert found.found_by == "cloth"
    places = np.random.default_rng(2).uniform(0, 10, (50, 2))
    assert found.height_m(places) - base_m == pytest.approx(hill(places), abs=0.05)
    assert found.slope == pytest.approx(np.hypot(*SLOPE), abs=0.005)


def test_a_plot_whose_ground_was_cut_away_stands_on_the_plane_of_its_feet():
    cloud, _ = plot(with_ground=False)
    found = ground_finder.find(cloud)
    assert found.found_by == "feet of the stems"
    assert found.height_m(STEMS) == pytest.approx(hill(STEMS), abs=0.15)


def test_a_single_tree_stands_on_its_foot_and_not_under_its_crown():
    cloud = Cloud(tree(np.zeros(2), np.random.default_rng(3)) + np.array([0, 0, 5.0]))
    found = ground_finder.find(cloud)
    assert found.is_flat
    assert found.lowest_m == pytest.approx(5.0, abs=0.1)


def test_points_that_the_file_calls_ground_are_taken_before_a_cloth():
    cloud, label = plot()
    classes = np.where(label == 0, 2, 1).astype(np.uint8)
    # A scatter of echoes from below, which a lowest point would take for ground.
    below = Cloud(np.column_stack([STEMS, hill(STEMS) - 3.0]))
    xyz = np.concatenate([cloud.xyz_m, below.xyz_m])
    found = ground_finder.find(
        Cloud(xyz, attributes={"Classification": np.append(classes, [1, 1, 1]).astype(np.uint8)})
    )
    assert found.found_by == "ground class"
    assert found.height_m(STEMS) == pytest.approx(hill(STEMS), abs=0.05)


def test_a_stated_height_is_one_of_the_world():
    cloud = Cloud(np.zeros((30, 3)), np.array([0.0, 0.0, 270.0]))
    assert ground_finder.find(cloud, given_z_m=280.5).lowest_m == pytest.approx(10.5)


def test_ground_survives_writing_and_its_mesh_lies_on_it(tmp_path):
    found = ground_finder.find(plot()[0])
    ground_surface.write(tmp_path / "ground.nc", found, np.zeros(3), "EPSG:25832")
    again = ground_surface.read(tmp_path / "ground.nc")
    assert np.array_equal(again.z_m, found.z_m)
    mesh = found.mesh()
    assert (mesh.triangle_normal[:, 2] > 0).all()
    assert mesh.vertices_m[:, 2] == pytest.approx(found.height_m(mesh.vertices_m[:, :2]))


def test_every_stem_is_found_once_from_west_to_east():
    cloud, _ = plot()
    found = stems.find(cloud.xyz_m, ground_finder.find(cloud))
    order = np.argsort(STEMS[:, 0])
    assert found[["x_m", "y_m"]].to_numpy() == pytest.approx(STEMS[order], abs=0.03)
    assert found["z_m"].to_numpy() == pytest.approx(hill(STEMS[order]), abs=0.05)
    assert list(found["id"]) == [1, 2, 3]
    assert found["width_m"].to_numpy() == pytest.approx(0.2, abs=0.05)


def test_shrubs_and_fence_posts_are_no_stems():
    rng = np.random.default_rng(5)
    shrub = rng.normal(0, 0.4, (5000, 3)) * [2, 2, 0.6] + [5, 5, 0.6]
    cloud, _ = plot()
    low = Cloud(np.concatenate([cloud.xyz_m, shrub[shrub[:, 2] > 0.1]]))
    assert len(stems.find(low.xyz_m, ground_finder.find(low))) == 3


def test_points_go_to_the_tree_that_they_are_joined_to():
    cloud, label = plot()
    divided = trees.divide(cloud, ground_finder.find(cloud))
    assert divided.found_by == "stems"
    number = {1: 1, 2: 3, 3: 2}  # trees in the order of their stems from west to east
    truth = np.array([0, *(number[k] for k in (1, 2, 3))])[label]
    high = cloud.xyz_m[:, 2] - hill(cloud.xyz_m[:, :2]) > 0.3
    assert (divided.tree == truth)[high].mean() > 0.99
    assert (divided.tree[label == 0] == 0).mean() > 0.99


def test_a_cloud_from_above_without_stems_is_divided_by_crowns():
    cloud, label = plot()
    high = cloud.xyz_m[:, 2] - hill(cloud.xyz_m[:, :2]) > 2.5
    seen = Cloud(cloud.xyz_m[high | (label == 0)])
    divided = trees.divide(seen, ground_finder.find(seen))
    assert divided.found_by == "crowns"
    assert len(divided.stems) == 3
    tops = divided.stems[["x_m", "y_m"]].to_numpy()
    for at in STEMS:
        assert np.hypot(*(tops - at).T).min() < 1.0


def test_a_tree_is_chosen_by_number_or_by_a_place_in_the_world():
    cloud, _ = plot()
    divided = trees.divide(cloud, ground_finder.find(cloud))
    origin = np.array([410_000.0, 5_317_000.0, 0.0])
    assert trees.choose(divided.stems, origin, number=2) == 2
    near = origin[:2] + STEMS[1] + 0.7
    assert trees.choose(divided.stems, origin, at_m=near) == 3
    with pytest.raises(InputError, match=r"tree.id: 9`; expected one of the 3 trees .* 1 at \[41"):
        trees.choose(divided.stems, origin, number=9)
    with pytest.raises(InputError, match=r"tree.at: \[0, 0\]`, 5,332,\d\d\d.\d m from the nearest"):
        trees.choose(divided.stems, origin, at_m=(0, 0))
    assert trees.neighbours(divided, 2, within_m=6.5) == [1, 3]
    assert trees.neighbours(divided, 2, within_m=5.0) == []
