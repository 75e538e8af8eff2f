"""A cloud comes back from every format as it was, in its place, or with an error that helps."""

import laspy
import numpy as np
import pye57
import pytest

from dapple.errors import EmptyCloudError, InputError
from dapple.formats import cloud_las, clouds
from dapple.formats.cloud_ptx import scans
from dapple.formats.clouds import Cloud

UTM = np.array([410500.0, 5317080.0, 280.0])


def some_cloud(origin_m=UTM, n=500) -> Cloud:
    rng = np.random.default_rng(7)
    return Cloud(
        np.round(rng.uniform(-5, 15, (n, 3)), 4),
        np.array(origin_m, float),
        {
            "Reflectance": rng.normal(-6, 3, n).astype(np.float32),
            "Deviation": rng.integers(0, 40, n).astype(np.float32),
            "Classification": rng.choice(np.array([0, 4], np.uint8), n),
            "PointSourceId": rng.integers(1, 9, n).astype(np.uint16),
        },
    )


def assert_same(found: Cloud, expected: Cloud, tolerance_m=1e-9):
    assert found.world_xyz_m == pytest.approx(expected.world_xyz_m, abs=tolerance_m)
    assert set(found.attributes) == set(expected.attributes)
    for name, values in expected.attributes.items():
        assert found.attributes[name] == pytest.approx(values), name


@pytest.mark.parametrize("suffix", [".laz", ".las", ".ply"])
@pytest.mark.parametrize("origin_m", [UTM, (0, 0, 0)])
def test_a_cloud_survives_writing_and_reading_with_its_origin(tmp_path, suffix, origin_m):
    cloud = some_cloud(origin_m)
    clouds.write(tmp_path / f"cloud{suffix}", cloud)
    found = clouds.read(tmp_path / f"cloud{suffix}")
    assert found.origin_m.tolist() == list(origin_m)
    assert_same(found, cloud)
    assert found.attributes["Classification"].dtype == np.uint8


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".xyz"])
def test_a_text_cloud_survives_and_finds_an_origin_of_its_own(tmp_path, suffix):
    cloud = some_cloud()
    clouds.write(tmp_path / f"cloud{suffix}", cloud)
    found = clouds.read(tmp_path / f"cloud{suffix}")
    assert found.origin_m.tolist() == [410490.0, 5317070.0, 0.0]
    assert_same(found, cloud, tolerance_m=1e-6)


def test_las_coordinates_relative_to_the_origin_are_whole_steps(tmp_path):
    cloud = some_cloud()
    clouds.write(tmp_path / "a.laz", cloud, scale_m=0.001)
    steps = clouds.read(tmp_path / "a.laz").xyz_m / 0.001
    assert np.array_equal(np.rint(cloud.xyz_m / 0.001) * 0.001, np.rint(steps) * 0.001)


def test_written_las_is_1_4_format_6_in_world_coordinates_with_float32_extras(tmp_path):
    cloud = some_cloud()
    clouds.write(tmp_path / "a.laz", cloud)
    las = laspy.read(tmp_path / "a.laz")
    assert (str(las.header.version), las.header.point_format.id) == ("1.4", 6)
    assert las.header.offsets.tolist() == UTM.tolist()
    assert np.asarray(las.xyz) == pytest.approx(cloud.world_xyz_m, abs=1e-4)
    assert np.asarray(las["Reflectance"]).dtype == np.float32


def test_all_wood_is_not_the_same_as_never_classified(tmp_path):
    cloud = some_cloud()
    wood = cloud.select(cloud.attributes["Classification"] == clouds.WOOD)
    clouds.write(tmp_path / "wood.laz", wood)
    assert "Classification" in clouds.read(tmp_path / "wood.laz").attributes
    foreign_las(tmp_path / "foreign.las", wood.xyz_m)
    assert "Classification" not in clouds.read(tmp_path / "foreign.las").attributes


def foreign_las(path, xyz, offsets=(0, 0, 0)):
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.offsets, header.scales = offsets, (0.001, 0.001, 0.001)
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.asarray(xyz, float).T
    las.write(path)


def test_a_foreign_las_without_offset_gets_an_origin_where_float32_is_too_coarse(tmp_path):
    world = some_cloud().world_xyz_m[:, [0, 0, 2]]
    foreign_las(tmp_path / "utm.las", world)
    found = clouds.read(tmp_path / "utm.las")
    assert found.origin_m.tolist() == [410490.0, 410490.0, 0.0]
    assert found.world_xyz_m == pytest.approx(world, abs=6e-4)


def test_reading_in_pieces_gives_the_whole_with_one_origin(tmp_path):
    clouds.write(tmp_path / "a.laz", some_cloud())
    pieces = list(clouds.iterate(tmp_path / "a.laz", chunk=150))
    assert [len(piece) for piece in pieces] == [150, 150, 150, 50]
    whole = clouds.read(tmp_path / "a.laz")
    assert np.array_equal(np.concatenate([piece.xyz_m for piece in pieces]), whole.xyz_m)
    assert all(np.array_equal(piece.origin_m, whole.origin_m) for piece in pieces)


def test_the_scalar_fields_of_cloudcompare_lose_their_prefix(tmp_path):
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\ncomment Created by CloudCompare\nelement vertex 2\n"
        "property float x\nproperty float y\nproperty float z\nproperty float scalar_Reflectance\n"
        "property float scalar_return_number\nend_header\n1 2 3 -5.5 1\n4 5 6 -7.5 2\n"
    )
    found = clouds.read(tmp_path / "a.ply")
    assert found.attributes["Reflectance"].tolist() == [-5.5, -7.5]
    assert found.attributes["ReturnNumber"].tolist() == [1, 2]
    assert found.xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_faces_after_the_points_of_a_ply_are_left_alone(tmp_path):
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    assert len(clouds.read(tmp_path / "a.ply")) == 3


@pytest.mark.parametrize(
    ("text", "attributes"),
    [
        ("X Y Z\n1 2 3\n4 5 6\n", []),
        ("1 2 3\n4 5 6\n", []),
        ("1,2,3,-4\n4,5,6,-5\n", ["column_4"]),
        ("# from a scanner\n1;2;3\n4;5;6\n", []),
        ("//X,Y,Z,Reflectance\n1,2,3,-4\n4,5,6,-5\n", ["Reflectance"]),
        ('"x","y","z","target_count"\n1,2,3,1\n4,5,6,2\n', ["NumberOfReturns"]),
        ("Reflectance\tX\tY\tZ\n-4\t1\t2\t3\n-5\t4\t5\t6\n", ["Reflectance"]),
        ("2\n1 2 3 100\n4 5 6 200\n", ["column_4"]),
    ],
)
def test_text_is_read_with_or_without_a_header_and_with_any_separator(tmp_path, text, attributes):
    (tmp_path / "a.txt").write_text(text)
    found = clouds.read(tmp_path / "a.txt")
    assert found.xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(found.attributes) == attributes


def test_e57_scans_are_posed_and_numbered(tmp_path):
    local = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 1.0]])
    quarter_turn = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    places = [UTM, UTM + np.array([10, 0, 0])]
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        for place in places:
            data = {f"cartesian{axis}": local[:, k].copy() for k, axis in enumerate("XYZ")}
            data["intensity"] = np.array([0.25, 0.5], np.float32)
            file.write_scan_raw(data, rotation=quarter_turn, translation=place)
    found = clouds.read(tmp_path / "a.e57")
    turned = np.array([[0.0, 1.0, 0.0], [0.0, 2.0, 1.0]])
    assert found.world_xyz_m == pytest.approx(np.concatenate([turned + p for p in places]))
    assert found.attributes["PointSourceId"].tolist() == [1, 1, 2, 2]
    assert found.attributes["RelativeIntensity"].tolist() == [0.25, 0.5, 0.25, 0.5]
    assert clouds.scan_positions(tmp_path / "a.e57") == pytest.approx(np.array(places))


PTX = """2
2
{0} {1} {2}
1 0 0
0 1 0
0 0 1
0 1 0 0
-1 0 0 0
0 0 1 0
{0} {1} {2} 1
1 0 0 0.5
0 0 0 0.5
2 0 1 0.25
0 0 0 0.5
"""


def test_ptx_keeps_poses_and_misses(tmp_path):
    (tmp_path / "a.ptx").write_text(PTX.format(*UTM) + PTX.format(*(UTM + 10)))
    found = clouds.read(tmp_path / "a.ptx")
    turned = np.array([[0.0, 1.0, 0.0], [0.0, 2.0, 1.0]]) + UTM
    assert found.world_xyz_m == pytest.approx(np.concatenate([turned, turned + 10]))
    assert found.attributes["PointSourceId"].tolist() == [1, 1, 2, 2]
    assert clouds.scan_positions(tmp_path / "a.ptx") == pytest.approx(np.array([UTM, UTM + 10]))
    (number, first), _ = scans(tmp_path / "a.ptx")
    assert number == 1
    assert first.hit.tolist() == [[True, False], [True, False]]


def test_an_attribute_that_is_missing_is_named_with_those_that_are_there():
    cloud = some_cloud()
    assert clouds.require(cloud, "Deviation", "a.laz") is cloud.attributes["Deviation"]
    with pytest.raises(InputError, match=r"a.laz: found no attribute 'Amplitude' .*Reflectance"):
        clouds.require(cloud, "Amplitude", "a.laz")


def test_a_missing_file_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"gone.laz: found no file"):
        clouds.read(tmp_path / "gone.laz")


def test_an_unknown_suffix_names_the_known_ones(tmp_path):
    known = r"\.laz, \.ply, \.e57, \.ptx, \.pcd, \.txt"
    with pytest.raises(InputError, match=rf"suffix '.rcp'.*{known}"):
        clouds.read(tmp_path / "cloud.rcp")
    with pytest.raises(InputError, match=r"suffix '.e57'.*can write: \.las"):
        clouds.write(tmp_path / "cloud.e57", some_cloud())


@pytest.mark.parametrize("suffix", sorted(clouds.READERS))
def test_an_empty_file_is_an_error_in_every_format(tmp_path, suffix):
    (tmp_path / f"a{suffix}").touch()
    with pytest.raises(InputError, match=r"empty file \(0 bytes\)"):
        clouds.read(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", sorted(clouds.READERS))
def test_a_file_of_something_else_is_an_error_in_every_format(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_text("this is a letter,\nnot a cloud\nof points\n")
    with pytest.raises(InputError, match=rf"a{suffix}: found"):
        clouds.read(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".laz", ".las", ".ply"])
@pytest.mark.parametrize("share", [0.3, 0.7, 0.98])
def test_a_truncated_file_is_an_error(tmp_path, suffix, share):
    whole, cut = tmp_path / f"whole{suffix}", tmp_path / f"cut{suffix}"
    clouds.write(whole, some_cloud(n=5000))
    data = whole.read_bytes()
    cut.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=rf"cut{suffix}: found"):
        clouds.read(cut)


@pytest.mark.parametrize("suffix", [".las", ".ply", ".pcd"])
def test_a_file_that_lacks_its_last_byte_is_an_error(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    if suffix == ".pcd":
        head = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 50\nDATA binary\n"
        path.write_bytes(head.encode() + np.ones(150, "<f4").tobytes())
    else:
        clouds.write(path, some_cloud(n=50))
    assert len(clouds.read(path)) == 50
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(InputError, match=rf"a{suffix}: found"):
        clouds.read(path)


def test_a_truncated_ptx_is_an_error(tmp_path):
    (tmp_path / "a.ptx").write_text(PTX.format(*UTM).rsplit("\n", 2)[0])
    with pytest.raises(InputError, match="3 of the 4 shots of scan 1"):
        clouds.read(tmp_path / "a.ptx")


def test_a_truncated_e57_is_an_error(tmp_path):
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw({f"cartesian{axis}": np.arange(2000.0) for axis in "XYZ"})
    data = (tmp_path / "a.e57").read_bytes()
    (tmp_path / "cut.e57").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"cut.e57: found no readable E57 file .*BadFileLength"):
        clouds.read(tmp_path / "cut.e57")


@pytest.mark.parametrize("suffix", [".laz", ".ply", ".txt"])
def test_a_cloud_without_points_is_an_error_of_its_own_kind(tmp_path, suffix):
    clouds.write(tmp_path / f"a{suffix}", some_cloud().select(np.zeros(500, bool)))
    with pytest.raises(EmptyCloudError, match="found 0 points"):
        clouds.read(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".ply", ".txt"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_coordinates_that_are_no_numbers_are_counted_and_located(tmp_path, suffix, value):
    cloud = some_cloud((0, 0, 0))
    cloud.xyz_m[[40, 300], 1] = value
    clouds.write(tmp_path / f"a{suffix}", cloud)
    with pytest.raises(InputError, match=r"2 points with coordinates .* the first is point 40"):
        clouds.read(tmp_path / f"a{suffix}")


def test_large_coordinates_in_single_precision_are_refused_because_they_are_lost(tmp_path):
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n410505.3 5317088.3 288.7\n"
    )
    with pytest.raises(InputError, match=r"410505 m in 32-bit floats, 0.03125 m apart"):
        clouds.read(tmp_path / "a.ply")


def test_a_line_longer_than_the_header_is_refused(tmp_path):
    (tmp_path / "a.txt").write_text("X Y Z\n1 2 3\n4 5 6 7\n")
    with pytest.raises(InputError, match=r"a.txt: found"):
        clouds.read(tmp_path / "a.txt")


def test_a_word_among_the_numbers_is_named(tmp_path):
    (tmp_path / "a.txt").write_text("X Y Z\n1 2 3\n4 five 6\n")
    with pytest.raises(InputError, match="'five' in column Y, data row 2"):
        clouds.read(tmp_path / "a.txt")


def test_an_attribute_that_las_would_cut_is_refused_and_leaves_no_file(tmp_path):
    cloud = Cloud(np.zeros((1, 3)), attributes={"Classification": np.array([300])})
    with pytest.raises(InputError, match="Classification = 300"):
        clouds.write(tmp_path / "a.laz", cloud)
    assert list(tmp_path.iterdir()) == []


def test_a_point_beyond_the_reach_of_las_is_refused(tmp_path):
    with pytest.raises(InputError, match="a point 1000000 m from the local origin"):
        clouds.write(tmp_path / "a.laz", Cloud(np.array([[1e6, 0.0, 0.0]])))


def test_the_day_of_writing_does_not_change_a_byte(tmp_path):
    clouds.write(tmp_path / "tree.laz", some_cloud())
    with laspy.open(tmp_path / "tree.laz") as file:
        assert file.header.creation_date == cloud_las.SAME_DAY
