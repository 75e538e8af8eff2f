"""Leaf or wood by what virtual scans teach: features, trees as arrays, the model that ships."""

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier
from tests.unit.test_classify import a_scan_of, tree

from dapple.cloud import boosted_trees, eigenvalues, learned
from dapple.cloud.classify import classify
from dapple.cloud.scores import scores
from dapple.errors import EmptyCloudError, InputError
from dapple.formats.clouds import Cloud
from dapple.virtual import labelled_scans, leaf_wood_training
from dapple.virtual.plant_tubes import Axes, tubes


@pytest.mark.parametrize(("flat", "n_axes"), [((1, 0, 0), 1), ((1, 1, 0), 2), ((1, 1, 1), 3)])
def test_a_line_has_one_axis_a_disc_two_and_a_ball_three(flat, n_axes):
    points = np.random.default_rng(3).normal(size=(200, 3)) * flat
    found = eigenvalues.around(points, 100.0)
    variances = np.linalg.eigvalsh(np.cov(points.T, bias=True))
    np.testing.assert_allclose(found.spread_m[0] ** 2, variances, atol=1e-8)
    assert np.count_nonzero(found.spread_m[0] > 1e-3) == n_axes
    assert found.points[0] == 200
    np.testing.assert_allclose(found.axes[0] @ found.axes[0].T, np.eye(3), atol=1e-12)


def test_a_neighbourhood_is_a_voxel_and_those_around_it():
    rng = np.random.default_rng(4)
    points_m = rng.random((3000, 3)) * [1.0, 0.7, 0.4] + [1000.0, -20.0, 300.0]
    values = rng.normal(size=(3000, 1))
    found = eigenvalues.around(points_m, 0.1, values)
    cell = np.floor((points_m - points_m.min(axis=0)) / 0.1)
    for point in (0, 77, 2999):
        near = (np.abs(cell - cell[point]) <= 1).all(axis=1)
        row = found.voxel_of_point[point]
        assert found.points[row] == near.sum()
        assert found.filled[row] == len(np.unique(cell[near], axis=0))
        spread_m = np.sqrt(np.linalg.eigvalsh(np.cov(points_m[near].T, bias=True)))
        np.testing.assert_allclose(found.spread_m[row], spread_m, rtol=1e-6)
        about = found.mean[row, 0], found.deviation[row, 0], found.largest[row, 0]
        own = values[near, 0]
        np.testing.assert_allclose(about, (own.mean(), own.std(), own.max()), rtol=1e-9)


def some_rows(n=4000, seed=5):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(n, 3)).astype(np.float32)
    return rows, rows[:, 0] * rows[:, 1] + 0.3 * rng.normal(size=n) > 0


def test_trees_as_arrays_say_what_scikit_learns_say():
    rows, positive = some_rows()
    found = leaf_wood_training.fitted(rows, positive, seed=1)
    model = HistGradientBoostingClassifier(**leaf_wood_training.LEARNING, random_state=1)
    expected = model.fit(rows, positive).decision_function(rows)
    np.testing.assert_allclose(found.log_odds(rows), expected, atol=1e-4)


def test_a_file_gives_back_the_models_it_was_given(tmp_path):
    rows, positive = some_rows()
    models = {"one": leaf_wood_training.fitted(rows, positive, seed=1)}
    for name in ("a.npz", "b.npz"):
        boosted_trees.write(tmp_path / name, models)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    again = boosted_trees.read(tmp_path / "a.npz", "one")
    np.testing.assert_array_equal(again.log_odds(rows), models["one"].log_odds(rows))
    with pytest.raises(InputError, match="found models one; expected other"):
        boosted_trees.read(tmp_path / "a.npz", "other")


def test_a_model_cannot_bring_code(tmp_path):
    np.savez(tmp_path / "bad.npz", **{"shape.baseline": np.array([{}], dtype=object)})
    with pytest.raises(InputError, match="arrays of numbers"):
        boosted_trees.read(tmp_path / "bad.npz", "shape")


def test_a_file_that_is_no_model_is_named(tmp_path):
    (tmp_path / "text.npz").write_text("no model")
    with pytest.raises(InputError, match=r"text.npz: found .*; expected a model"):
        boosted_trees.read(tmp_path / "text.npz", "shape")


def test_the_models_that_come_along_are_small_and_fit_their_features():
    assert learned.MODEL.stat().st_size < 1_000_000
    xyz_m, is_leaf = tree(spacing_m=0.03)
    for name, bright in learned.MODELS.items():
        rows, _ = learned.features(a_scan_of(xyz_m, is_leaf), reflectance=bright)
        model = boosted_trees.read(learned.MODEL, name)
        assert model.feature.max() < rows.shape[1]
        assert np.isfinite(model.log_odds(rows)).all()


def test_where_the_tree_stands_and_how_high_does_not_matter():
    xyz_m, is_leaf = tree(spacing_m=0.02)
    cloud = a_scan_of(xyz_m, is_leaf)
    moved = Cloud(xyz_m + np.array([37.0, -12.0, 1000.0]), attributes=cloud.attributes)
    kinds = [classify(one, "learned")[0].attributes["Classification"] for one in (cloud, moved)]
    assert np.mean(kinds[0] == kinds[1]) > 0.999


def test_a_handful_of_points_is_not_a_tree_for_the_model_either():
    with pytest.raises(EmptyCloudError, match="at least 50 points"):
        classify(Cloud(np.zeros((10, 3))), "learned")


@pytest.fixture(scope="module")
def pine():
    """A young tree of a kind that the model has not seen, by a coarse scan."""
    size = {"height_m": 3.0, "crown_radius_m": 0.8, "dbh_m": 0.08, "leaf_area_m2": 4.0}
    plant = labelled_scans.unseen("pine", seed=3, **size)
    scan = {"positions": 3, "radius_m": 5.0, "angular_step_deg": 0.15}
    return labelled_scans.scan(plant, seed=3, **scan)


def test_on_a_kind_of_tree_that_it_has_not_seen_it_finds_the_wood_that_is_wider_than_the_beam(pine):
    truth = pine.attributes["TrueClass"]
    visible = ~(pine.attributes["BeamShare"] < 1)
    classified, facts = classify(pine, "learned")
    assert facts["with_reflectance"] == 1.0
    found = scores(classified.attributes["Classification"][visible], truth[visible])
    assert found["wood"]["f1"] > 0.8


@pytest.mark.parametrize("method", ["learned", "geometry"])
def test_half_of_the_points_make_the_same_classes(pine, method):
    half = np.random.default_rng(8).random(len(pine)) < 0.5
    kinds = classify(pine, method)[0].attributes["Classification"]
    fewer = classify(pine.select(half), method)[0].attributes["Classification"]
    assert np.mean(kinds[half] == fewer) > 0.97


@pytest.mark.parametrize("radius_m", [0.002, 0.01, 0.04])
def test_the_thickness_of_a_branch_is_that_of_its_tube(radius_m):
    along_m = np.column_stack([np.zeros((9, 2)), np.linspace(0, 1.6, 9)])
    branch = tubes(Axes(along_m, np.full(9, radius_m), np.zeros(9, np.int64)))
    beside_m = np.array([[radius_m, 0.0, 0.3], [0.0, -radius_m, 0.9]])
    assert labelled_scans.thickness(branch, beside_m) == pytest.approx(2 * radius_m, rel=0.1)


def test_no_two_drawn_trees_are_alike_and_each_comes_again():
    first, again, other = (labelled_scans.draw(k, 1) for k in (0, 0, 1))
    np.testing.assert_array_equal(first[0]["leaf"].vertices_m, again[0]["leaf"].vertices_m)
    assert first[1] == again[1] != other[1]
