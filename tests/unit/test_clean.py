"""The noise filter: which points go at which step, and what stands for those that stay."""

import json
import time

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dapple import pdal, programs
from dapple.cloud import outliers, voxel_groups
from dapple.cloud.clean import clean, thin
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import clouds
from dapple.formats.clouds import Cloud
from dapple.formats.ground_surface import flat

ORIGIN_M = np.array([410500.0, 5317080.0, 280.0])
PROGRAMS = {"cloudcompare": "CloudCompare", "pdal": "pdal"}


def blob_with_strays(n=5000, n_strays=40, seed=1):
    """A dense ball of 0.5 m, and strays 3 to 6 m away in all directions."""
    rng = np.random.default_rng(seed)
    ball = rng.normal(size=(n, 3))
    ball *= 0.5 * rng.random((n, 1)) ** (1 / 3) / np.linalg.norm(ball, axis=1, keepdims=True)
    strays = rng.normal(size=(n_strays, 3))
    strays *= rng.uniform(3, 6, (n_strays, 1)) / np.linalg.norm(strays, axis=1, keepdims=True)
    return np.concatenate([ball, strays]) + 10.0


def inliers_by_definition(xyz_m, neighbours, multiplier):
    distance, _ = cKDTree(xyz_m).query(xyz_m, neighbours + 1)
    mean = distance[:, 1:].mean(axis=1)
    limit = mean.mean() + multiplier * mean.std()
    return np.flatnonzero(mean <= limit), np.min(np.abs(mean - limit)) / limit


def test_both_back_ends_remove_the_same_points():
    xyz_m = np.round(blob_with_strays(), 4)
    expected, margin = inliers_by_definition(xyz_m, 8, 3.0)
    assert margin > 1e-6, "a point on the limit itself would be judged by rounding"
    assert 4800 < len(expected) < 5010
    for backend in PROGRAMS:
        np.testing.assert_array_equal(outliers.inliers(xyz_m, backend)[0], expected)


@pytest.mark.parametrize("neighbours", [1, 4, 20])
def test_neighbours_do_not_count_the_point_itself_in_either_back_end(neighbours):
    xyz_m = np.round(blob_with_strays(n=800, n_strays=10, seed=neighbours), 4)
    expected, margin = inliers_by_definition(xyz_m, neighbours, 2.0)
    assert margin > 1e-6
    for backend in PROGRAMS:
        found, _ = outliers.inliers(xyz_m, backend, neighbours=neighbours, multiplier=2.0)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("backend", PROGRAMS)
def test_every_filter_takes_its_own_points_and_counts_them(backend):
    ball = blob_with_strays(n=4000, n_strays=1)
    n = len(ball)
    reflectance = np.full(n, -6.0, np.float32)
    deviation = np.full(n, 3.0, np.float32)
    reflectance[:10] = [-15.0, *np.full(9, -20.0)]  # at the limit goes as well
    deviation[5:30] = [*np.full(24, 40.0), 15.0]
    deviation[30] = 14.99
    scan = Cloud(ball, attributes={"Reflectance": reflectance, "Deviation": deviation})
    cloud, counts = clean(scan, outlier_backend=backend, thin_voxel_m=None)
    assert counts["input"] == counts["after_height"] == n
    assert counts["after_reflectance"] == n - 10
    assert counts["after_deviation"] == n - 30
    assert len(cloud) == counts["after_outliers"] == counts["after_thinning"] < n - 30
    assert np.linalg.norm(cloud.xyz_m - 10.0, axis=1).max() < 0.51, "the stray is gone"
    assert cloud.attributes["Reflectance"].min() > -15
    assert cloud.attributes["Deviation"].max() == pytest.approx(14.99)
    assert counts["versions"][PROGRAMS[backend]] != "unknown"
    json.dumps(counts)


def test_a_cloud_without_reflectance_skips_those_filters_and_says_so():
    _, counts = clean(Cloud(blob_with_strays()), thin_voxel_m=None)
    assert counts["after_deviation"] == counts["input"]
    assert counts["skipped"][:2] == [
        "reflectance: the points have no dimension Reflectance",
        "deviation: the points have no dimension Deviation",
    ]


def test_points_below_the_given_height_go_and_those_at_it_stay():
    xyz_m = np.stack([np.arange(40) * 0.1, np.zeros(40), np.arange(40) * 0.05], axis=1)
    cloud, counts = clean(
        Cloud(xyz_m), min_height_m=0.5, ground=flat(0.25), outlier_backend="none", thin_voxel_m=None
    )
    assert counts["after_height"] == 25
    assert cloud.xyz_m[:, 2].min() == pytest.approx(0.75)


def test_points_known_as_noise_before_are_not_taken_for_outliers():
    xyz_m = blob_with_strays()
    noise = Cloud(xyz_m, attributes={"Classification": np.full(len(xyz_m), 7, np.uint8)})
    kept = {name: clean(noise, outlier_backend=name)[1]["after_outliers"] for name in PROGRAMS}
    assert kept["pdal"] == kept["cloudcompare"] > 4800


def test_the_local_frame_and_the_attributes_survive():
    xyz_m = blob_with_strays(n_strays=0)
    scan = (np.arange(len(xyz_m)) % 8).astype(np.uint16)
    attributes = {"PointSourceId": scan, "TrueClass": np.where(scan < 4, 4, 0).astype(np.uint8)}
    cloud = Cloud(xyz_m, ORIGIN_M, attributes)
    cleaned, _ = clean(cloud, outlier_backend="none", thin_voxel_m=None)
    np.testing.assert_array_equal(cleaned.origin_m, ORIGIN_M)
    np.testing.assert_array_equal(cleaned.xyz_m, xyz_m)
    assert cleaned.attributes.keys() == attributes.keys()
    for name, values in attributes.items():
        np.testing.assert_array_equal(cleaned.attributes[name], values)


@pytest.mark.parametrize("backend", PROGRAMS)
def test_the_same_scan_gives_the_same_points(backend):
    scan = Cloud(blob_with_strays())
    first, second = (clean(scan, outlier_backend=backend)[0] for _ in range(2))
    np.testing.assert_array_equal(first.xyz_m, second.xyz_m)


def test_thinning_gives_the_centre_of_gravity_of_each_voxel():
    xyz_m = np.array([[0.001, 0.002, 0.003], [0.009, 0.004, 0.003], [0.011, 0.002, 0.003]])
    thinned = thin(Cloud(xyz_m), 0.01)
    np.testing.assert_allclose(thinned.xyz_m, [[0.005, 0.003, 0.003], [0.011, 0.002, 0.003]])


def test_thinning_averages_what_was_measured_and_votes_on_what_was_named():
    cloud = Cloud(
        np.full((4, 3), 0.005),
        attributes={
            "Reflectance": np.array([-4.0, -8.0, np.nan, -6.0], np.float32),
            "Deviation": np.array([1, 2, 3, 4], np.uint16),
            "TrueClass": np.array([0, 4, 4, 2], np.uint8),
            "PointSourceId": np.array([3, 1, 3, 1], np.uint16),
        },
    )
    thinned = thin(cloud, 0.01).attributes
    assert thinned["Reflectance"] == pytest.approx(-6.0)  # mean of decibels, NaN does not count
    assert thinned["Deviation"] == 2  # 2.5 rounded to even
    assert thinned["TrueClass"] == 4
    assert thinned["PointSourceId"] == 1  # of equals the smallest
    assert {name: values.dtype for name, values in thinned.items()} == {
        name: values.dtype for name, values in cloud.attributes.items()
    }


def test_thinning_leaves_one_point_per_voxel_inside_that_voxel():
    rng = np.random.default_rng(3)
    cloud = Cloud(rng.integers(-1000, 1000, (20000, 3)) * 1e-4 + 5e-5)
    thinned = thin(cloud, 0.01)
    cells = np.unique(np.floor(cloud.xyz_m / 0.01), axis=0)
    np.testing.assert_array_equal(np.floor(thinned.xyz_m / 0.01), cells)


def test_thinning_does_not_depend_on_the_order_of_the_points():
    rng = np.random.default_rng(4)
    xyz_m = rng.uniform(-0.1, 0.1, (5000, 3))
    shuffled = xyz_m[rng.permutation(len(xyz_m))]
    np.testing.assert_allclose(thin(Cloud(xyz_m), 0.01).xyz_m, thin(Cloud(shuffled), 0.01).xyz_m)


def test_a_decimal_coordinate_on_a_face_belongs_to_the_upper_voxel():
    x_m = np.arange(-500, 500) * 0.01
    xyz_m = np.stack([x_m, np.zeros_like(x_m), np.zeros_like(x_m)], axis=1)
    assert len(voxel_groups.group(xyz_m, 0.01).start) == len(x_m)
    assert len(voxel_groups.group(xyz_m, 0.05).start) == len(x_m) / 5


def test_a_filter_that_removes_everything_is_named_with_the_file():
    xyz_m = blob_with_strays(n=100)
    dark = Cloud(xyz_m, attributes={"Reflectance": np.full(len(xyz_m), -30, np.float32)})
    found = r"dark.laz: found no point left of 140 after the reflectance filter"
    with pytest.raises(EmptyCloudError, match=found):
        clean(dark, where="dark.laz")


def test_an_unknown_back_end_is_an_error_with_the_known_ones():
    with pytest.raises(InputError, match="cloudcompare, pdal, none"):
        clean(Cloud(blob_with_strays(n=100)), outlier_backend="pcl")


def test_a_missing_program_is_an_error_with_a_remedy():
    with pytest.raises(InputError, match=r"no such program.*set-up of the README"):
        pdal.find("/nowhere/pdal")


def test_a_failing_program_shows_its_command_its_exit_code_and_its_last_words():
    with pytest.raises(programs.ProgramError, match=r"sh -c .*exit code 3: that went wrong"):
        programs.run(["sh", "-c", "echo that went wrong >&2; exit 3"], limit_s=60)


def test_a_failing_pipeline_shows_what_pdal_said(tmp_path):
    clouds.write(tmp_path / "a.laz", Cloud(np.ones((3, 3))))
    with pytest.raises(programs.ProgramError, match=r"exit code 1.*filters\.nonsense"):
        pdal.run([str(tmp_path / "a.laz"), {"type": "filters.nonsense"}], limit_s=60)


@pytest.mark.parametrize("backend", ["cloudcompare", "pdal"])
def test_thousands_of_points_at_a_few_places_are_judged_as_places(backend):
    """A scan written to steps of 10 cm, and 20,000 echoes at one place: in seconds, all kept."""
    rng = np.random.default_rng(6)
    xyz_m = np.rint(rng.uniform(0, 1, (8000, 3)) / 0.1) * 0.1
    stray = np.array([[30.0, 0.0, 0.0]])
    everything = np.concatenate([xyz_m, np.tile(xyz_m[:1], (20_000, 1)), np.tile(stray, (9, 1))])
    started = time.process_time()
    kept, _ = outliers.inliers(everything, backend)
    assert time.process_time() - started < 5
    np.testing.assert_array_equal(kept, np.arange(28_000))
