"""Leaf or wood: thresholds, votes, the course of branches, and how agreement is scored."""

import warnings

import numpy as np
import pytest

from dapple.cloud import branches, eigenvalues
from dapple.cloud.auto import chosen
from dapple.cloud.classifiers import CLASSIFIERS
from dapple.cloud.classify import classify, codes, doubts, majority
from dapple.cloud.clean import thin
from dapple.cloud.geometry import by_geometry
from dapple.cloud.reflectance import NotSeparableWarning, by_reflectance, find_threshold
from dapple.cloud.scores import scores
from dapple.errors import EmptyCloudError, InputError
from dapple.formats.clouds import Cloud


def two_normals(dark, bright, share_dark=0.5, n=40_000, seed=1):
    rng = np.random.default_rng(seed)
    n_dark = int(n * share_dark)
    return np.concatenate([rng.normal(*dark, n_dark), rng.normal(*bright, n - n_dark)])


def tube(start, end, radius_m, spacing_m, rng):
    """Points on the surface of a cylinder, one per square of `spacing_m`."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = np.linalg.norm(end - start)
    n = int(length * 2 * np.pi * radius_m / spacing_m**2) + 2
    along = (end - start) / length
    side = np.cross(along, [0.3, 0.5, 0.81])
    side /= np.linalg.norm(side)
    turn = rng.uniform(0, 2 * np.pi, (n, 1))
    around = np.cos(turn) * side + np.sin(turn) * np.cross(along, side)
    return start + rng.uniform(0, length, (n, 1)) * along + radius_m * around


def leaves(centres, rng, n_points=20, radius_m=0.03):
    """Flat discs of random tilt."""
    u = rng.normal(size=(len(centres), 1, 3))
    v = np.cross(u, rng.normal(size=(len(centres), 1, 3)))
    u, v = (w / np.linalg.norm(w, axis=2, keepdims=True) for w in (u, v))
    r = radius_m * np.sqrt(rng.random((len(centres), n_points, 1)))
    turn = rng.uniform(0, 2 * np.pi, (len(centres), n_points, 1))
    return (centres[:, None] + r * (np.cos(turn) * u + np.sin(turn) * v)).reshape(-1, 3)


def tree(spacing_m=0.01, seed=1):
    """A stem of 16 cm, eight branches of 6 cm, and leaves around the outer halves of those."""
    rng = np.random.default_rng(seed)
    wood, crown = [tube([0, 0, 0], [0, 0, 3], 0.08, spacing_m, rng)], []
    for k in range(8):
        azimuth = 2 * np.pi * k / 8
        tip = [1.5 * np.sin(azimuth), 1.5 * np.cos(azimuth), 3.0 + 0.2 * (k % 3)]
        foot = np.array([0, 0, 1.6 + 0.15 * k])
        wood.append(tube(foot, tip, 0.03, spacing_m, rng))
        outer = foot + rng.uniform(0.45, 1.05, (220, 1)) * (tip - foot)
        crown.append(leaves(outer + rng.normal(0, 0.18, (220, 3)), rng))
    wood, crown = np.concatenate(wood), np.concatenate(crown)
    is_leaf = np.concatenate([np.zeros(len(wood), bool), np.ones(len(crown), bool)])
    return np.concatenate([wood, crown]), is_leaf


def test_dark_points_are_leaf_and_the_threshold_itself_is_leaf():
    np.testing.assert_array_equal(
        by_reflectance([-9.0, -5.4, -5.3, 0.0]), [True, True, False, False]
    )
    np.testing.assert_array_equal(codes(by_reflectance([-9.0, 0.0])), [4, 0])


def test_a_point_without_reflectance_is_an_error():
    with pytest.raises(InputError, match="1 points without a value"):
        by_reflectance([-9.0, np.nan])


@pytest.mark.parametrize(("leaves_db", "is_doubted"), [(-8.0, False), (-4.0, True)])
def test_leaves_that_are_brighter_than_the_threshold_are_doubted(leaves_db, is_doubted):
    """A fifth of the points are bark."""
    db = two_normals((leaves_db, 0.8), (-2.0, 0.8), share_dark=0.8, n=2000)
    places_m = np.random.default_rng(1).uniform(0, 5, (len(db), 3))
    cloud = Cloud(places_m, np.zeros(3), {"Reflectance": db})
    _, facts = classify(cloud, "auto", threshold_db=-5.4)
    found = doubts(facts, -5.4, "tree.laz")
    assert [one.yaml for one in found] == ["classify:\n  method: learned"] * is_doubted


def test_equal_normals_part_in_the_middle():
    found = find_threshold(two_normals((-9, 1), (-3, 1)))
    assert found.threshold_db == pytest.approx(-6, abs=0.05)
    assert found.separation == pytest.approx(6, abs=0.1)


def test_the_threshold_shifts_towards_the_rarer_class_by_the_log_of_the_odds():
    share, distance = 0.8, 6.0
    found = find_threshold(two_normals((-9, 1), (-3, 1), share_dark=share))
    expected = -6 + np.log(share / (1 - share)) / distance
    assert found.threshold_db == pytest.approx(expected, abs=0.06)
    np.testing.assert_allclose(found.share, [0.8, 0.2], atol=0.01)


def test_the_threshold_of_unequal_widths_is_where_the_densities_cross():
    found = find_threshold(two_normals((-9, 0.7), (-3, 1.6)))
    z = (found.threshold_db - found.mean_db) / found.sd_db
    density = found.share / found.sd_db * np.exp(-0.5 * z**2)
    assert density[0] == pytest.approx(density[1], rel=1e-6)


def test_overlapping_classes_give_a_warning_and_distinct_ones_none():
    with pytest.warns(NotSeparableWarning, match="Ashman's D"):
        find_threshold(two_normals((-7, 1.5), (-4.5, 1.5)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        find_threshold(two_normals((-9, 1), (-3, 1)))


@pytest.mark.parametrize(
    "values", [np.full(500, -7.0), np.arange(50.0), np.full(500, np.nan)], ids=str
)
def test_no_two_classes_is_an_error(values):
    with pytest.raises(InputError, match="Give a threshold"):
        find_threshold(values)


def test_the_threshold_is_the_same_every_time():
    values = two_normals((-9, 1.4), (-3, 1.1))
    first, second = (find_threshold(values, max_points=5000) for _ in range(2))
    assert first.threshold_db == second.threshold_db


def test_the_majority_of_a_voxel_decides_and_equal_votes_make_leaf():
    xyz_m = np.array([[0.01, 0, 0], [0.02, 0, 0], [0.03, 0, 0], [0.06, 0, 0], [0.07, 0, 0]])
    is_leaf = np.array([False, False, True, True, False])
    expected = [False, False, False, True, True]
    np.testing.assert_array_equal(majority(xyz_m, is_leaf, 0.05), expected)


def test_voxels_start_at_the_local_origin_on_both_sides():
    xyz_m = np.array([[-0.01, 0, 0], [0.01, 0, 0], [0.02, 0, 0]])
    np.testing.assert_array_equal(
        majority(xyz_m, np.array([True, False, False]), 0.05), [True, False, False]
    )


def test_a_second_vote_changes_nothing():
    rng = np.random.default_rng(2)
    xyz_m, is_leaf = rng.random((5000, 3)), rng.random(5000) < 0.5
    once = majority(xyz_m, is_leaf)
    np.testing.assert_array_equal(majority(xyz_m, once), once)


def test_every_path_of_a_string_of_nodes_ends_at_its_foot():
    nodes_m = np.stack([np.zeros(50), np.zeros(50), np.arange(50) * 0.02], axis=1)
    carried = branches.support(nodes_m, root_top_m=0.0)
    np.testing.assert_array_equal(carried, np.arange(50, 0, -1))


def test_a_loose_piece_joins_the_tree_where_it_is_nearest():
    stem = np.stack([np.zeros(60), np.zeros(60), np.arange(60) * 0.02], axis=1)
    loose = stem[:20] + np.array([0.5, 0, 0.4])
    carried = branches.support(np.concatenate([stem, loose]), root_top_m=0.0)
    assert carried[0] == 80


def test_the_area_of_two_stems_is_the_sum_of_their_circles():
    rng = np.random.default_rng(6)
    stems = [tube([x, 0, 0], [x, 0, 1], r, 0.01, rng) for x, r in ((0, 0.1), (2, 0.06))]
    area_m2 = branches.stem_area_m2(np.concatenate(stems), 0.02, foot_m=0.0, slice_m=0.2)
    assert area_m2 == pytest.approx(np.pi * (0.1**2 + 0.06**2), rel=0.05)


def test_a_flared_foot_makes_no_thicker_stem():
    rng = np.random.default_rng(6)
    stem = tube([0, 0, 0], [0, 0, 1], 0.08, 0.01, rng)
    flare = 1 + 1.5 * np.exp(-stem[:, 2:] / 0.08)
    area_m2 = branches.stem_area_m2(stem * np.hstack([flare, flare, flare**0]), 0.02, 0.0, 0.2)
    assert area_m2 == pytest.approx(np.pi * 0.08**2, rel=0.1)


def test_a_node_inside_the_branch_is_not_beyond_it():
    nodes_m = np.array([[0, 0, 0], [0.05, 0, 0], [0.115, 0, 0], [1, 0, 0]], float)
    beyond = branches.distance_beyond_wood(nodes_m, nodes_m[:1], np.array([0.05]), reach_m=0.04)
    np.testing.assert_allclose(beyond, [-0.1, -0.05, 0.015, 0.04])


def test_stem_and_branches_are_wood_and_the_crown_is_leaf():
    xyz_m, is_leaf = tree()
    found = scores(codes(by_geometry(xyz_m)), codes(is_leaf))
    assert found["kappa"] > 0.6
    assert found["wood"]["precision"] > 0.9
    stem = np.hypot(*xyz_m[:, :2].T) < 0.1
    assert by_geometry(xyz_m)[stem & (xyz_m[:, 2] < 1.5)].mean() < 0.02


def test_on_a_coarse_cloud_the_stem_is_still_wood():
    xyz_m, is_leaf = tree()
    coarse = thin(Cloud(xyz_m, attributes={"Classification": codes(is_leaf)}), 0.04)
    found = by_geometry(coarse.xyz_m)
    stem = (np.hypot(*coarse.xyz_m[:, :2].T) < 0.1) & (coarse.xyz_m[:, 2] < 1.5)
    assert found[stem].mean() < 0.05
    assert scores(codes(found), coarse.attributes["Classification"])["kappa"] > 0.4


def test_the_order_of_the_points_does_not_matter():
    xyz_m, _ = tree()
    order = np.random.default_rng(2).permutation(len(xyz_m))
    assert np.mean(by_geometry(xyz_m[order]) == by_geometry(xyz_m)[order]) > 0.995


def test_what_lies_between_sure_groups_goes_to_the_one_that_it_is_like():
    rng = np.random.default_rng(4)
    rows = np.concatenate([rng.normal(m, 0.5, (100, 3)) for m in (2.0, -2.0, 1.2, -1.2)])
    group = np.repeat([0, 1, 2, 3], 100)
    odds = eigenvalues.discriminate(rows, group == 0, group == 1)
    assert (odds[group == 2] > 0).mean() > 0.95
    assert (odds[group == 3] < 0).mean() > 0.95
    assert np.abs(odds).max() == 3
    few = eigenvalues.discriminate(rows, np.arange(400) < 20, group == 1)
    assert not few.any()


@pytest.mark.parametrize(
    "changed",
    [
        lambda xyz: xyz + np.array([0.0, 0.0, 1000.0]),
        lambda xyz: xyz + np.array([37.013, -12.007, 251.3]),
        lambda xyz: 100 * xyz,
        lambda xyz: xyz / 0.3048,
    ],
    ids=["high up", "elsewhere", "in centimetres", "in feet"],
)
def test_neither_the_place_nor_the_unit_of_a_tree_matters(changed):
    xyz_m, _ = tree()
    assert np.mean(by_geometry(changed(xyz_m)) == by_geometry(xyz_m)) > 0.999


def test_which_way_a_tree_faces_hardly_matters():
    xyz_m, _ = tree()
    turned = xyz_m[:, [1, 0, 2]] * [-1, 1, 1]
    assert np.mean(by_geometry(turned) == by_geometry(xyz_m)) > 0.9


def test_branches_too_thin_to_count_are_leaf_where_the_configuration_says_so():
    xyz_m, _ = tree(spacing_m=0.02)
    kinds = [
        classify(Cloud(xyz_m), "geometry", geometry={"thinnest_branch": t})[0] for t in (0.1, 3.0)
    ]
    wood = [np.mean(one.attributes["Classification"] == 0) for one in kinds]
    assert wood[1] < 0.7 * wood[0]


def test_a_handful_of_points_is_not_a_tree():
    with pytest.raises(EmptyCloudError, match="at least 50 points"):
        by_geometry(np.zeros((10, 3)))


def test_scores_follow_their_definitions():
    truth = np.array([4] * 6 + [0] * 4)
    predicted = np.array([4, 4, 4, 4, 4, 0, 0, 0, 0, 4])
    found = scores(predicted, truth)
    assert found["leaf"] == {
        "precision": 5 / 6,
        "recall": 5 / 6,
        "f1": pytest.approx(5 / 6),
        "n": 6,
    }
    assert found["wood"]["f1"] == pytest.approx(0.75)
    assert found["accuracy"] == pytest.approx(0.8)
    chance = 0.6 * 0.6 + 0.4 * 0.4
    assert found["kappa"] == pytest.approx((0.8 - chance) / (1 - chance))


def test_ground_and_noise_do_not_count_in_the_scores():
    found = scores(np.array([4, 0, 4, 0]), np.array([4, 0, 2, 7]))
    assert (found["n"], found["n_other"], found["accuracy"]) == (2, 2, 1.0)


def test_scores_of_different_clouds_are_an_error():
    with pytest.raises(InputError, match="the same cloud"):
        scores(np.zeros(3), np.zeros(4))
    with pytest.raises(InputError, match="codes \\[1\\]"):
        scores(np.array([1, 4]), np.array([0, 4]))
    with pytest.raises(EmptyCloudError):
        scores(np.zeros(3), np.full(3, 7))


def a_scan_of(xyz_m, is_leaf):
    """Leaves dark, wood bright, the truth beside them."""
    rng = np.random.default_rng(7)
    reflectance_db = np.where(is_leaf, -9.0, -3.0) + rng.normal(0, 0.5, len(xyz_m))
    truth = np.where(is_leaf, 4, 0).astype(np.uint8)
    return Cloud(xyz_m, attributes={"Reflectance": reflectance_db, "TrueClass": truth})


@pytest.mark.parametrize("method", CLASSIFIERS)
def test_every_classifier_classifies_and_is_scored(method):
    xyz_m, is_leaf = tree(spacing_m=0.02)
    classified, facts = classify(a_scan_of(xyz_m, is_leaf), method, threshold_db=-6.0)
    kinds = classified.attributes["Classification"]
    assert set(np.unique(kinds)) <= {0, 4}
    assert facts["method"] == {"auto": "reflectance"}.get(method, method)
    assert facts["leaf_share"] == pytest.approx((kinds == 4).mean())
    assert facts["scores"]["leaf"]["f1"] > 0.6
    if CLASSIFIERS[method].needs:
        assert facts["scores"]["accuracy"] > 0.95


@pytest.mark.parametrize("method", CLASSIFIERS)
def test_what_a_classifier_needs_and_lacks_is_named_with_the_file(method):
    xyz_m, _ = tree(spacing_m=0.03)
    if CLASSIFIERS[method].needs:
        with pytest.raises(InputError, match=r"tree.laz: found no attribute 'Reflectance'"):
            classify(Cloud(xyz_m), method, threshold_db=-6.0, where="tree.laz")
    else:
        assert "scores" not in classify(Cloud(xyz_m), method)[1]


def test_a_classifier_that_there_is_not_is_an_error_and_not_all_leaf():
    with pytest.raises(InputError, match="found 'forest'; expected one of auto, reflectance"):
        classify(Cloud(np.ones((100, 3))), "forest")


def test_auto_takes_reflectance_in_decibels_and_shape_without_it():
    cloud = Cloud(np.zeros((4, 3)), attributes={"Reflectance": np.array([-9.0, -8.0, -3.0, -2.0])})
    assert chosen(cloud) == "reflectance"
    assert chosen(Cloud(np.zeros((4, 3)))) == "geometry"
    for other in (np.full(4, -8.0), np.array([1e3, 2e3, 3e3, 4e3]), np.full(4, np.nan)):
        assert chosen(Cloud(np.zeros((4, 3)), attributes={"Reflectance": other})) == "geometry"
