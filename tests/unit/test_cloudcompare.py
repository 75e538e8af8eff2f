"""CloudCompare as dapple uses it: outliers and cloud-to-mesh distances, whichever way it is run."""

import importlib.util

import numpy as np
import pytest

from dapple import programs
from dapple.cloud import cloudcompare
from dapple.errors import EmptyCloudError, InputError
from dapple.formats.meshes import Mesh

ENGINES = [
    cloudcompare.CommandLine,
    pytest.param(
        cloudcompare.CloudComPy,
        marks=pytest.mark.skipif(
            importlib.util.find_spec("cloudComPy") is None, reason="cloudComPy is not installed"
        ),
    ),
]


def unit_square():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def distance_to_unit_square(xyz_m):
    beyond = xyz_m[:, :2] - np.clip(xyz_m[:, :2], 0, 1)
    return np.sqrt((beyond**2).sum(axis=1) + xyz_m[:, 2] ** 2)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_distance_to_a_square_is_pythagoras(engine):
    points = np.random.default_rng(1).uniform(-1, 2, (500, 3))
    distance_m = engine().distance_to_mesh(points, unit_square())
    np.testing.assert_allclose(distance_m, distance_to_unit_square(points), atol=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_distances_are_as_exact_far_from_the_origin(engine):
    shift_m = np.array([410500.0, 5317080.0, 280.0])
    points = np.random.default_rng(2).uniform(-1, 2, (500, 3))
    square = unit_square()
    far = Mesh(square.vertices_m + shift_m, square.faces, square.element)
    distance_m = engine().distance_to_mesh(points + shift_m, far)
    np.testing.assert_allclose(distance_m, distance_to_unit_square(points), atol=2e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_side_of_the_surface_does_not_matter(engine):
    points = np.array([[0.5, 0.5, 0.25], [0.5, 0.5, -0.25], [0.2, 0.7, 0.0]])
    square = unit_square()
    flipped = Mesh(square.vertices_m, square.faces[:, ::-1], square.element)
    for mesh in (square, flipped):
        np.testing.assert_allclose(
            engine().distance_to_mesh(points, mesh), [0.25, 0.25, 0], atol=1e-6
        )


@pytest.mark.parametrize("engine", ENGINES)
def test_a_flat_surface_through_the_middle_of_the_cloud_is_seen(engine):
    points = np.array([[0.5, 0.5, 0.0], [0.2, 0.7, 0.0], [0.5, 0.5, 0.3], [0.5, 0.5, -0.3]])
    distance_m = engine().distance_to_mesh(points, unit_square())
    np.testing.assert_allclose(distance_m, [0, 0, 0.3, 0.3], atol=1e-6)


def test_a_distance_that_is_not_a_number_is_an_error():
    broken = unit_square()
    broken.vertices_m[:] = np.nan
    with pytest.raises(programs.ProgramError):
        cloudcompare.cloud_to_mesh_distance(np.ones((3, 3)), broken)


@pytest.mark.parametrize("engine", ENGINES)
def test_one_stray_point_is_the_outlier(engine):
    grid = np.stack(np.meshgrid(*[np.arange(8) * 0.1] * 3), axis=-1).reshape(-1, 3)
    points = np.insert(grid, 100, [5.0, 5.0, 5.0], axis=0)
    kept = engine().inliers(points, 6, 5.0)
    np.testing.assert_array_equal(kept, np.delete(np.arange(len(points)), 100))


def test_row_numbers_beyond_single_precision_come_back_exactly():
    rows = np.array([0, 1, 2**20, 2**24 - 1, 2**24 + 1, 3 * 2**30 + 7])
    high = (rows // cloudcompare.INDEX_BASE).astype(np.float32)
    low = (rows % cloudcompare.INDEX_BASE).astype(np.float32)
    np.testing.assert_array_equal(cloudcompare._rows(high, low), rows)


def test_the_summary_of_distances_is_in_metres():
    facts = cloudcompare.summary(np.array([0.0, 0.01, 0.02, 0.03, 0.94]))
    assert facts["mean_m"] == pytest.approx(0.2)
    assert facts["median_m"] == 0.02
    assert facts["share_close"] == pytest.approx(0.6)


def test_nothing_to_compare_is_an_error():
    empty = Mesh(np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty(0, np.int32))
    with pytest.raises(EmptyCloudError, match="no triangles"):
        cloudcompare.cloud_to_mesh_distance(np.ones((3, 3)), empty)
    with pytest.raises(EmptyCloudError, match="no points"):
        cloudcompare.cloud_to_mesh_distance(np.empty((0, 3)), unit_square())


def test_an_absent_program_is_an_error_that_says_how_to_get_it():
    with pytest.raises(InputError, match="apt-get install"):
        cloudcompare.CommandLine("/nowhere/CloudCompare")
