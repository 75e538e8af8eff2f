"""The noise filter: which points go at which step, and what stands for those that stay."""

import json

import laspy
import numpy as np
import pytest
from scipy.spatial import cKDTree

from dapple import pdal, programs
from dapple.cloud import cloudcompare, voxel_groups
from dapple.cloud.clean import clean, thin
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import clouds
from dapple.formats.clouds import Cloud

ORIGIN_M = np.array([410500.0, 5317080.0, 280.0])


def write_laz(path, xyz_m, **attributes):
    """A LAZ file as the scanner writes it: world coordinates, header offset = local origin."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = ORIGIN_M, np.full(3, 1e-4)
    for name, values in attributes.items():
        if name not in header.point_format.standard_dimension_names:
            header.add_extra_dim(laspy.ExtraBytesParams(name, values.dtype))
    las = laspy.LasData(header)
    las.xyz = xyz_m + ORIGIN_M
    for name, values in attributes.items():
        las[name] = values
    las.write(path)
    return path


def read_laz(path):
    las = laspy.read(path)
    return las, las.xyz - las.header.offsets


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


def inliers_by_pdal(folder, xyz_m, neighbours, multiplier):
    given = write_laz(folder / "given.laz", xyz_m, row=np.arange(len(xyz_m), dtype=np.int32))
    kept = folder / "kept.las"
    outliers = pdal.remove_outliers(neighbours, multiplier)
    pdal.run([str(given), *outliers, pdal.write_las(kept, ORIGIN_M)])
    return np.sort(laspy.read(kept)["row"])


def test_both_back_ends_remove_the_same_points(tmp_path):
    xyz_m = np.round(blob_with_strays(), 4)
    expected, margin = inliers_by_definition(xyz_m, 8, 3.0)
    assert margin > 1e-6, "a point on the limit itself would be judged by rounding"
    assert 4800 < len(expected) < 5010
    engine = cloudcompare.CommandLine()
    np.testing.assert_array_equal(engine.inliers(xyz_m, 8, 3.0), expected)
    np.testing.assert_array_equal(inliers_by_pdal(tmp_path, xyz_m, 8, 3.0), expected)


@pytest.mark.parametrize("neighbours", [1, 4, 20])
def test_neighbours_do_not_count_the_point_itself_in_either_back_end(tmp_path, neighbours):
    xyz_m = np.round(blob_with_strays(n=800, n_strays=10, seed=neighbours), 4)
    expected, margin = inliers_by_definition(xyz_m, neighbours, 2.0)
    assert margin > 1e-6
    engine = cloudcompare.CommandLine()
    np.testing.assert_array_equal(engine.inliers(xyz_m, neighbours, 2.0), expected)
    np.testing.assert_array_equal(inliers_by_pdal(tmp_path, xyz_m, neighbours, 2.0), expected)


@pytest.mark.parametrize("backend", ["cloudcompare", "pdal"])
def test_every_filter_takes_its_own_points_and_counts_them(tmp_path, backend):
    ball = blob_with_strays(n=4000, n_strays=1)
    n = len(ball)
    reflectance = np.full(n, -6.0, np.float32)
    deviation = np.full(n, 3.0, np.float32)
    reflectance[:10] = [-15.0, *np.full(9, -20.0)]  # at the limit goes as well
    deviation[5:30] = [*np.full(24, 40.0), 15.0]
    deviation[30] = 14.99
    path = write_laz(tmp_path / "scan.laz", ball, Reflectance=reflectance, Deviation=deviation)
    counts = clean(path, tmp_path / "clean.laz", outlier_backend=backend, thin_voxel_m=None)
    assert counts["input"] == counts["after_height"] == n
    assert counts["after_reflectance"] == n - 10
    assert counts["after_deviation"] == n - 30
    las, xyz_m = read_laz(tmp_path / "clean.laz")
    assert len(las) == counts["after_outliers"] == counts["after_thinning"] < n - 30
    assert np.linalg.norm(xyz_m - 10.0, axis=1).max() < 0.51, "the stray is gone"
    assert las.Reflectance.min() > -15
    assert las.Deviation.max() == pytest.approx(14.99)
    assert counts["versions"][{"cloudcompare": "CloudCompare"}.get(backend, "pdal")] != "unknown"
    json.dumps(counts)


def test_a_cloud_without_reflectance_skips_those_filters_and_says_so(tmp_path):
    path = write_laz(tmp_path / "xyz.laz", blob_with_strays())
    counts = clean(path, tmp_path / "clean.laz", thin_voxel_m=None)
    assert counts["after_deviation"] == counts["input"]
    assert counts["skipped"][:2] == [
        "reflectance: the points have no dimension Reflectance",
        "deviation: the points have no dimension Deviation",
    ]


def test_the_spelling_of_a_dimension_does_not_matter(tmp_path):
    xyz_m = blob_with_strays(n=100)
    bright = np.where(np.arange(len(xyz_m)) < 60, -3, -30).astype(np.float32)
    path = write_laz(tmp_path / "scan.laz", xyz_m, reflectance=bright)
    assert clean(path, tmp_path / "clean.laz", outlier_backend="none")["after_reflectance"] == 60


def test_points_below_the_given_height_go_and_those_at_it_stay(tmp_path):
    xyz_m = np.stack([np.arange(40) * 0.1, np.zeros(40), np.arange(40) * 0.05], axis=1)
    path = write_laz(tmp_path / "line.laz", xyz_m)
    counts = clean(
        path,
        tmp_path / "clean.laz",
        min_height_m=0.5,
        ground_z_m=0.25,
        outlier_backend="none",
        thin_voxel_m=None,
    )
    assert counts["after_height"] == 25
    assert read_laz(tmp_path / "clean.laz")[1][:, 2].min() == pytest.approx(0.75)


def test_points_known_as_noise_before_are_not_taken_for_outliers(tmp_path):
    xyz_m = blob_with_strays()
    noise = np.full(len(xyz_m), 7, np.uint8)
    path = write_laz(tmp_path / "noise.laz", xyz_m, classification=noise)
    kept = {
        backend: clean(path, tmp_path / "clean.laz", outlier_backend=backend)["after_outliers"]
        for backend in ("pdal", "cloudcompare")
    }
    assert kept["pdal"] == kept["cloudcompare"] > 4800


def test_the_local_frame_and_the_scan_attributes_survive(tmp_path):
    xyz_m = np.round(blob_with_strays(n_strays=0), 4)
    scan = (np.arange(len(xyz_m)) % 8).astype(np.uint16)
    path = write_laz(
        tmp_path / "scan.laz",
        xyz_m,
        point_source_id=scan,
        TrueClass=np.where(scan < 4, 4, 0).astype(np.uint8),
    )
    clean(path, tmp_path / "clean.laz", outlier_backend="none", thin_voxel_m=None)
    las, cleaned_m = read_laz(tmp_path / "clean.laz")
    np.testing.assert_array_equal(las.header.offsets, ORIGIN_M)
    np.testing.assert_allclose(cleaned_m, xyz_m, atol=1e-6)
    np.testing.assert_array_equal(las.point_source_id, scan)
    np.testing.assert_array_equal(las.TrueClass == 4, scan < 4)


def test_fields_in_use_stay_in_use_even_where_they_are_zero(tmp_path):
    n = 200
    attributes = {
        "Classification": np.zeros(n, np.uint8),
        "PointSourceId": np.zeros(n, np.uint16),
        "Reflectance": np.full(n, -3.0, np.float32),
    }
    cloud = Cloud(np.random.default_rng(1).random((n, 3)), ORIGIN_M, attributes)
    clouds.write(tmp_path / "scan.laz", cloud)
    clean(tmp_path / "scan.laz", tmp_path / "clean.laz", outlier_backend="none", thin_voxel_m=None)
    cleaned = clouds.read(tmp_path / "clean.laz")
    assert set(cleaned.attributes) == set(attributes)
    np.testing.assert_array_equal(cleaned.origin_m, ORIGIN_M)


def test_the_same_scan_gives_the_same_bytes(tmp_path):
    path = write_laz(tmp_path / "scan.laz", blob_with_strays())
    outputs = [tmp_path / "a.laz", tmp_path / "b.laz"]
    for out in outputs:
        clean(path, out)
    np.testing.assert_array_equal(*(laspy.read(out).points.array for out in outputs))


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


def test_a_filter_that_removes_everything_is_named(tmp_path):
    xyz_m = blob_with_strays(n=100)
    dark = np.full(len(xyz_m), -30, np.float32)
    path = write_laz(tmp_path / "dark.laz", xyz_m, Reflectance=dark)
    with pytest.raises(EmptyCloudError, match=r"no point left of 140 after the reflectance filter"):
        clean(path, tmp_path / "clean.laz")
    assert not (tmp_path / "clean.laz").exists()


def test_an_empty_a_missing_and_a_foreign_file_are_told_apart(tmp_path):
    empty = write_laz(tmp_path / "empty.laz", np.empty((0, 3)))
    with pytest.raises(EmptyCloudError, match="no points"):
        clean(empty, tmp_path / "clean.laz")
    with pytest.raises(InputError, match="no file"):
        clean(tmp_path / "missing.laz", tmp_path / "clean.laz")
    (tmp_path / "text.laz").write_text("X Y Z\n1 2 3\n" * 100)
    with pytest.raises(InputError, match="not LASF"):
        clean(tmp_path / "text.laz", tmp_path / "clean.laz")


def test_a_truncated_scan_is_an_error_and_leaves_no_output(tmp_path):
    path = write_laz(tmp_path / "cut.laz", blob_with_strays())
    path.write_bytes(path.read_bytes()[:20000])
    with pytest.raises(InputError, match=r"cut\.laz|pdal"):
        clean(path, tmp_path / "clean.laz")
    assert not (tmp_path / "clean.laz").exists()


def test_an_unknown_back_end_is_an_error_with_the_known_ones(tmp_path):
    with pytest.raises(InputError, match="cloudcompare, pdal, none"):
        clean("scan.laz", tmp_path / "clean.laz", outlier_backend="pcl")


def test_a_missing_program_is_an_error_with_a_remedy():
    with pytest.raises(InputError, match=r"no such program.*set-up of the README"):
        pdal.find("/nowhere/pdal")


def test_a_failing_program_shows_its_command_its_exit_code_and_its_last_words():
    with pytest.raises(programs.ProgramError, match=r"sh -c .*exit code 3: that went wrong"):
        programs.run(["sh", "-c", "echo that went wrong >&2; exit 3"])


def test_a_failing_pipeline_shows_what_pdal_said(tmp_path):
    with pytest.raises(programs.ProgramError, match=r"exit code 1.*filters\.nonsense"):
        pdal.run(
            [str(write_laz(tmp_path / "a.laz", np.ones((3, 3)))), {"type": "filters.nonsense"}]
        )
