"""Point clouds with odd or damaged parts: what can be read is, the rest is told or refused."""

import dataclasses
import struct

import laspy
import numpy as np
import pye57
import pyproj
import pytest
from pye57 import libe57
from tests.unit.test_cloud_readers import ply_text
from tests.unit.test_las_readers import XYZ, described, las

from dapple.cloud import voxel_groups
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import cloud_crs, clouds, ply, shots
from dapple.formats.cloud_raw import AT_SCANNER

AXES = [f"property float {axis}" for axis in "xyz"]


def test_bytes_that_are_told_to_be_undocumented_are_stepped_over(tmp_path):
    values = np.zeros(400, [("unknown", "u1", 3), ("score", "<f4")])
    values["unknown"], values["score"] = 255, 2.5
    records = [described("reserved", 0, options=3) + described("score", 9)]
    cloud = clouds.read(las(tmp_path / "a.las", extra=values.tobytes(), records=records))
    assert set(cloud.attributes) == {"score"}
    assert set(cloud.attributes["score"]) == {2.5}


@pytest.mark.parametrize(
    ("kind", "said"), [(77, "unknown type (77)"), (10, "more extra bytes than a point has")]
)
def test_a_description_that_cannot_be_is_told_and_the_points_are_read(tmp_path, kind, said):
    cloud, source = clouds.read_with_source(
        las(tmp_path / "a.las", extra=bytes(4 * 400), records=[described("odd", kind)])
    )
    assert cloud.xyz_m == pytest.approx(XYZ, abs=1e-9)
    assert not cloud.attributes
    assert said in " ".join(source.notes)


def test_an_offset_of_extra_bytes_is_added_and_a_scale_of_nothing_is_none(tmp_path):
    shifted = bytearray(described("Reflectance", 4, options=8 | 16, scale=0.5))
    shifted[136:144] = struct.pack("<d", -20.0)
    raw = np.full(400, 6, "<i2").tobytes()
    found = clouds.read(las(tmp_path / "a.las", extra=raw, records=[bytes(shifted)]))
    assert set(found.attributes["Reflectance"]) == {-17.0}
    scaled = described("Reflectance", 4, options=8, scale=0.0)
    found = clouds.read(las(tmp_path / "b.las", extra=raw, records=[scaled]))
    assert set(found.attributes["Reflectance"]) == {6}


@pytest.mark.parametrize(
    ("at", "form", "values", "said"),
    [
        (94, "<H", [20], "a header of 20 bytes"),
        (96, "<I", [10**9], "points are to begin at 1,000,000,000"),
        (104, "<B", [42], "point format 42"),
        (105, "<H", [12], "points of 12 bytes"),
        (131, "<3d", [0.0, 1.0, 1.0], "a scale of"),
        (155, "<3d", [np.nan, 0.0, 0.0], "an offset of"),
    ],
)
def test_a_header_that_contradicts_itself_is_refused(tmp_path, at, form, values, said):
    raw = bytearray(las(tmp_path / "a.las").read_bytes())
    struct.pack_into(form, raw, at, *values)
    (tmp_path / "a.las").write_bytes(raw)
    with pytest.raises(InputError, match=said):
        clouds.read(tmp_path / "a.las")


def laz(path):
    clouds.write(path, clouds.Cloud(XYZ))
    return bytearray(path.read_bytes())


def test_compressed_points_without_the_word_how_are_refused(tmp_path):
    raw = laz(tmp_path / "a.laz")
    at = raw.index(b"laszip encoded")
    raw[at : at + 14] = b"something else"
    (tmp_path / "a.laz").write_bytes(raw)
    with pytest.raises(InputError, match="without the record that says how"):
        clouds.read(tmp_path / "a.laz")


@pytest.mark.parametrize("n_items", [1, 60_000])
def test_compressed_items_of_another_size_than_a_point_are_refused(tmp_path, n_items):
    raw = laz(tmp_path / "a.laz")
    record = raw.index(b"laszip encoded") - 2 + 54
    struct.pack_into("<H", raw, record + 32, n_items)
    struct.pack_into("<H", raw, record + 36, 7)
    (tmp_path / "a.laz").write_bytes(raw)
    with pytest.raises(InputError, match=r"compressed items of .* Export the file again"):
        clouds.read(tmp_path / "a.laz")


def test_a_laz_whose_table_of_chunks_is_told_at_its_end_is_read(tmp_path):
    """As a program leaves it that could not go back to the beginning."""
    raw = laz(tmp_path / "a.laz")
    data_at = struct.unpack_from("<I", raw, 96)[0]
    table_at = raw[data_at : data_at + 8]
    raw[data_at : data_at + 8] = struct.pack("<q", -1)
    (tmp_path / "a.laz").write_bytes(raw + table_at)
    assert clouds.read(tmp_path / "a.laz").xyz_m == pytest.approx(XYZ, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ply\nelement vertex 1\nend_header\n", "no format"),
        (ply_text(["property float x", "property colour y"], ""), "property colour y"),
        (ply_text([*AXES, "property float x"], ""), "element vertex with 2 rows"),
        (ply_text(AXES[:2], "1 2\n3 4\n"), "no vertices with x, y and z"),
        (ply_text(AXES, "", "element camera 9\nproperty float v"), "an end within"),
        (ply_text([*AXES, "property list uchar int v"], "1 2 3 0\n4 5 6\n"), "row 2 of vertex"),
    ],
)
def test_a_ply_that_is_damaged_names_what_is(tmp_path, text, said):
    (tmp_path / "a.ply").write_text(text)
    with pytest.raises(InputError, match=said):
        clouds.read(tmp_path / "a.ply")


def test_an_origin_that_is_no_place_is_none(tmp_path):
    text = ply_text(AXES, "1 2 3\n4 5 6\n", "comment origin_m 7 nan 9")
    (tmp_path / "a.ply").write_text(text)
    assert clouds.read(tmp_path / "a.ply").xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("listed", [False, True])
def test_binary_elements_before_the_vertices_are_passed_over(tmp_path, listed):
    own = "property list uchar short v" if listed else "property short v"
    head = ["ply", "format binary_little_endian 1.0", "element edge 2", own, "element vertex 2"]
    body = struct.pack("<BhBhh", 1, 7, 2, 8, 9) if listed else struct.pack("<2h", 7, 8)
    rows = np.array([[1, 2, 3], [4, 5, 6]], "<f4").tobytes()
    (tmp_path / "a.ply").write_bytes(
        "\n".join([*head, *AXES, "end_header", ""]).encode() + body + rows
    )
    assert clouds.read(tmp_path / "a.ply").xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]


def keys(*pairs):
    """A record of GeoTIFF keys that hold numbers themselves."""
    words = [1, 1, 0, len(pairs)]
    for key, value in pairs:
        words += [key, 0, 1, value]
    return {(cloud_crs.USER, cloud_crs.GEO_KEYS): [struct.pack(f"<{len(words)}H", *words)]}


def test_a_system_may_be_told_by_numbers_and_its_heights_by_another():
    assert cloud_crs.of_records(keys((3072, 25832))).to_epsg() == 25832
    both = cloud_crs.of_records(keys((3072, 25832), (4096, 7837)))
    assert [one.to_epsg() for one in both.sub_crs_list] == [25832, 7837]
    # Heights that nobody knows leave the system as it is.
    assert cloud_crs.of_records(keys((3072, 25832), (4096, 31999))).to_epsg() == 25832
    assert cloud_crs.of_records(keys((1024, 1))) is None


def test_units_may_be_told_without_a_system():
    name, units, notes = cloud_crs.describe(keys((3076, 9002)))
    assert (name, notes) == ("", ())
    assert units.horizontal_m == units.vertical_m == pytest.approx(0.3048)


def test_a_broken_system_is_a_note_for_points_and_an_error_for_crowns(tmp_path):
    broken = {(cloud_crs.USER, cloud_crs.WKT): [b"PROJCS[nothing"]}
    name, units, notes = cloud_crs.describe(broken)
    assert name == ""
    assert units.horizontal_m == 1.0
    assert "cannot be read" in notes[0]
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.add_crs(pyproj.CRS("EPSG:25832"))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = XYZ.T
    cloud.write(tmp_path / "a.las")
    raw = (tmp_path / "a.las").read_bytes()
    (tmp_path / "a.las").write_bytes(
        raw.replace(b"PROJCRS", b"XXXXCRS").replace(b"PROJCS", b"XXXXCS")
    )
    with pytest.raises(InputError, match=r"(?s)cannot be read .*a_srs"):
        cloud_crs.horizontal(tmp_path / "a.las", "")
    with pytest.raises(InputError, match="Check the path in the configuration"):
        cloud_crs.horizontal(tmp_path / "none.las", "")
    with pytest.raises(InputError, match="as in EPSG:25832"):
        cloud_crs.horizontal(las(tmp_path / "b.las"), "EPSG:0")


def e57(path, **fields):
    """A scan with these fields, as another program than pye57 may write it."""
    imf = pye57.E57(str(path), mode="w")
    scan = libe57.StructureNode(imf.image_file)
    scan.set("guid", libe57.StringNode(imf.image_file, "{1}"))
    prototype = libe57.StructureNode(imf.image_file)
    buffers = libe57.VectorSourceDestBuffer()
    columns = {name: np.asarray(values, float) for name, values in fields.items()}
    for name in columns:
        node = libe57.FloatNode(imf.image_file, 0.0, libe57.E57_DOUBLE, -1e6, 1e6)
        if name.endswith("Index") or name.startswith("return"):
            node = libe57.IntegerNode(imf.image_file, 0, 0, 10_000)
        prototype.set(name, node)
    points = libe57.CompressedVectorNode(
        imf.image_file, prototype, libe57.VectorNode(imf.image_file, True)
    )
    scan.set("points", points)
    imf.data3d.append(scan)
    for name, column in columns.items():
        buffers.append(
            libe57.SourceDestBuffer(imf.image_file, name, column, len(column), True, True)
        )
    writer = points.writer(buffers)
    writer.write(len(column))
    writer.close()
    imf.close()
    return path


def test_ranges_and_angles_of_an_e57_become_places_and_a_range_of_nothing_a_miss(tmp_path):
    quarter = np.pi / 2
    path = e57(
        tmp_path / "a.e57",
        sphericalRange=[2.0, 2.0, 2.0, 0.0],
        sphericalAzimuth=[0.0, quarter, 0.0, 0.3],
        sphericalElevation=[0.0, 0.0, quarter, 0.1],
    )
    cloud, source = clouds.read_with_source(path)
    assert cloud.world_xyz_m == pytest.approx(2 * np.eye(3), abs=1e-9)
    assert source.left_out == {AT_SCANNER: 1}


def test_returns_that_share_a_cell_are_one_shot_numbered_from_the_scanner_on(tmp_path):
    """Without any word on borders of rows and columns."""
    path = e57(
        tmp_path / "a.e57",
        cartesianX=[9.0, 3.0, 5.0, 5.0, 5.0],
        cartesianY=[0.0, 0.0, 1.0, 2.0, 3.0],
        cartesianZ=[0.0, 0.0, 1.0, 1.0, 1.0],
        columnIndex=[0, 0, 0, 1, 1],
        rowIndex=[0, 0, 1, 0, 1],
    )
    found = clouds.read(path).attributes
    assert found["ReturnNumber"].tolist() == [2, 1, 1, 1, 1]
    assert found["NumberOfReturns"].tolist() == [2, 2, 1, 1, 1]


def test_returns_of_an_e57_count_from_nought(tmp_path):
    path = e57(
        tmp_path / "a.e57",
        cartesianX=[9.0, 3.0],
        cartesianY=[0.0, 0.0],
        cartesianZ=[0.0, 1.0],
        returnIndex=[1, 0],
        returnCount=[2, 2],
    )
    found = clouds.read(path).attributes
    assert found["ReturnNumber"].tolist() == [2, 1]
    assert found["NumberOfReturns"].dtype == np.uint8


def test_an_e57_without_places_is_refused(tmp_path):
    path = e57(tmp_path / "a.e57", cartesianX=[9.0, 3.0], cartesianY=[0.0, 0.0])
    with pytest.raises(InputError, match="Copy or export the file again"):
        clouds.read(path)


PTX = ["2", "1", "1 2 3", "1 0 0", "0 1 0", "0 0 1", "1 0 0 0", "0 1 0 0", "0 0 1 0", "1 2 3 1"]


@pytest.mark.parametrize(
    ("line", "text", "said"),
    [
        (2, "1 2", "without position and 4 × 4 matrix"),
        (9, "1 nan 3 1", "numbers that are not finite"),
        (6, "2 0 0 0", "rotat"),
        (10, "1 2 3 4 5", "5 columns in scan 1"),
        (10, "", "an empty line among the shots"),
    ],
)
def test_a_ptx_that_cannot_be_says_what_of_it(tmp_path, line, text, said):
    lines = [*PTX, "1 1 1 0.5", "0 0 0 0.5"]
    lines[line] = text
    lines[11] = " ".join(["0"] * len(lines[10].split())) or lines[11]
    (tmp_path / "a.ptx").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=said):
        clouds.read(tmp_path / "a.ptx")


def test_a_scan_that_met_nothing_has_shots_and_no_points(tmp_path):
    (tmp_path / "a.ptx").write_text("\n".join([*PTX, "0 0 0 0.5", "0 0 0 0.5"]) + "\n")
    with pytest.raises(EmptyCloudError):
        clouds.read(tmp_path / "a.ptx")


def mesh_file(path, corners="vertex_indices", face=(0, 1, 2), faces=1):
    """A triangle in a PLY as dapple reads meshes."""
    head = ["ply", "format binary_little_endian 1.0", "element vertex 3", *AXES]
    if faces:
        head += ["element face 1", f"property list uchar int {corners}"]
    body = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    body += struct.pack(f"<B{len(face)}i", len(face), *face) if faces else b""
    path.write_bytes("\n".join([*head, "end_header", ""]).encode() + body)
    return path


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"corners": "edges"}, "faces that are not triangles"),
        ({"face": (0, 1, 2, 0)}, "faces that are not triangles"),
        ({"face": (0, 1, 7)}, "vert"),
        ({"faces": 0}, "no vertices or no faces"),
    ],
)
def test_a_mesh_of_anything_but_triangles_of_its_own_corners_is_refused(tmp_path, given, said):
    assert ply.read(mesh_file(tmp_path / "a.ply"))[1].tolist() == [[0, 1, 2]]
    with pytest.raises(InputError, match=said):
        ply.read(mesh_file(tmp_path / "b.ply", **given))


def test_voxels_have_a_size_and_their_numbers_an_end():
    far = np.array([[0.0, 0.0, 0.0], [1e7, 1e7, 1e7]])
    with pytest.raises(InputError, match="a size above 0 m"):
        voxel_groups.group(far, 0.0)
    with pytest.raises(InputError, match="an extent of"):
        voxel_groups.group(far, 1e-3)


def test_more_voxels_than_may_be_are_made_larger_until_they_are_few_enough():
    points = np.random.default_rng(5).uniform(0, 1, (2000, 3))
    groups, middle, size_m = voxel_groups.nodes(points, 0.01, 100)
    assert len(groups.start) <= 100
    assert 0.01 < size_m < 1.0
    assert np.average(middle, axis=0, weights=groups.size) == pytest.approx(points.mean(axis=0))


def test_shots_of_none_and_of_two_kinds_cannot_be_put_together():
    with pytest.raises(InputError, match="at least one chunk"):
        shots.concatenate([])
    plain = shots.Shots.none(np.zeros(3))
    told = dataclasses.replace(plain, truth=np.zeros(0, np.uint8))
    with pytest.raises(InputError, match="Drop the truth of all"):
        shots.concatenate([plain, told])
