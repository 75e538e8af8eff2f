"""Point clouds as other programs write them: read whole, or refused in one message."""

import gzip
import resource
import struct
import time

import laspy
import numpy as np
import pye57
import pytest
from pye57 import libe57

from dapple.cloud import selection
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import clouds
from dapple.formats.cloud_raw import AT_SCANNER, MISSED

XYZ = np.round(np.random.default_rng(4).uniform(-2, 9, (400, 3)), 4)


# --- LAS and LAZ ----------------------------------------------------------------------------


def described(name, kind, options=0, no_data=0.0, scale=1.0):
    """One description of extra bytes, 192 bytes."""
    text = struct.pack("<2xBB32s4x", kind, options, name.encode())
    return (
        text + struct.pack("<d", no_data) + bytes(64) + struct.pack("<3d", scale, 1, 1) + bytes(56)
    )


def las(path, xyz=XYZ, extra=b"", records=(), version=4, form=6, scale=1e-4, **head):
    """A LAS file byte by byte: `extra` behind every point, `records` of extra bytes before them."""
    size = laspy.PointFormat(form).size
    points = np.zeros((len(xyz), size + (len(extra) // len(xyz) if len(xyz) else 0)), np.uint8)
    points[:, :12] = np.rint(xyz / scale).astype("<i4").view(np.uint8)
    if extra:
        points[:, size:] = np.frombuffer(extra, np.uint8).reshape(len(xyz), -1)
    body = b"".join(
        struct.pack("<2x16sHH32s", b"LASF_Spec", 4, len(record), b"") + record for record in records
    )
    header = bytearray(375 if version == 4 else 227)
    header[:4] = b"LASF"
    struct.pack_into("<BB", header, 24, 1, version)
    struct.pack_into("<H", header, 94, len(header))
    struct.pack_into(
        "<IIBHI",
        header,
        96,
        len(header) + len(body),
        head.get("n_records", len(records)),
        form,
        points.shape[1],
        0 if version == 4 else len(xyz),
    )
    struct.pack_into("<6d", header, 131, scale, scale, scale, 0, 0, 0)
    bounds = np.stack([xyz.max(axis=0), xyz.min(axis=0)], axis=1).ravel()
    struct.pack_into("<6d", header, 179, *bounds)
    if version == 4:
        struct.pack_into("<QI", header, 235, head.get("extended_at", 0), head.get("n_extended", 0))
        struct.pack_into("<Q", header, 247, head.get("count", len(xyz)))
    path.write_bytes(bytes(header) + body + points.tobytes())
    return path


def test_extra_bytes_that_are_arrays_become_one_attribute_a_column(tmp_path):
    normal = np.random.default_rng(1).normal(size=(400, 3)).astype("<f4")
    path = las(tmp_path / "a.las", extra=normal.tobytes(), records=[described("Normal", 29)])
    found = clouds.read(path)
    assert found.xyz_m == pytest.approx(XYZ, abs=1e-9)
    for k in range(3):
        assert np.array_equal(found.attributes[f"Normal_{k + 1}"], normal[:, k])


def test_extra_bytes_that_nothing_describes_are_left_out_with_a_note(tmp_path):
    cloud, source = clouds.read_with_source(las(tmp_path / "a.las", extra=bytes(4 * 400)))
    assert cloud.xyz_m == pytest.approx(XYZ, abs=1e-9)
    assert not cloud.attributes
    assert "4 extra bytes of every point are not described" in " ".join(source.notes)


def test_extra_bytes_may_be_described_in_several_records(tmp_path):
    values = np.zeros(400, [("a", "<f4"), ("b", "<u2"), ("c", "<f4")])
    values["a"], values["b"], values["c"] = np.arange(400) / 3, 7, -1.5
    records = [described("Reflectance", 9) + described("Deviation", 3), described("score", 9)]
    found = clouds.read(las(tmp_path / "a.las", extra=values.tobytes(), records=records))
    assert np.array_equal(found.attributes["Reflectance"], values["a"])
    assert set(found.attributes["Deviation"]) == {7}
    assert set(found.attributes["score"]) == {-1.5}


def test_a_name_that_is_there_twice_is_told_apart(tmp_path):
    values = np.zeros(400, [("a", "<f4"), ("b", "<f4"), ("c", "u1")])
    values["a"], values["b"], values["c"] = 1, 2, 3
    records = [described("Amplitude", 9), described("amplitude", 9), described("Intensity", 1)]
    cloud, source = clouds.read_with_source(
        las(tmp_path / "a.las", extra=values.tobytes(), records=records)
    )
    assert {name: float(v[0]) for name, v in cloud.attributes.items()} == {
        "Amplitude": 1,
        "Amplitude_2": 2,
        "extra_Intensity": 3,
    }
    assert len(source.notes) == 2


def test_scaled_extra_bytes_come_in_their_unit_and_no_data_as_nan(tmp_path):
    raw = np.full(400, -1250, "<i2")
    raw[7] = -32768
    described_no_data = bytearray(described("Reflectance", 4, options=1 | 8, scale=0.01))
    described_no_data[40:48] = struct.pack("<q", -32768)
    found = clouds.read(
        las(tmp_path / "a.las", extra=raw.tobytes(), records=[bytes(described_no_data)])
    )
    assert np.isnan(found.attributes["Reflectance"][7])
    assert np.delete(found.attributes["Reflectance"], 7) == pytest.approx(-12.5)


@pytest.mark.parametrize(
    "head",
    [{"n_records": 2**31 - 1}, {"n_extended": 2**32 - 1, "extended_at": 375}],
    ids=["records", "extended records"],
)
def test_a_garbage_number_of_records_is_refused_at_once(tmp_path, head):
    path = las(tmp_path / "a.las", **head)
    start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=r"a.las: found a header with [\d,]+ records announced"):
        clouds.read(path)
    assert time.process_time() - start < 1
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000


@pytest.mark.parametrize("count", [401, 2**62])
def test_more_points_announced_than_there_are_is_an_incomplete_file(tmp_path, count):
    with pytest.raises(InputError, match=r"400 of the [0-9,]+ points"):
        clouds.read(las(tmp_path / "a.las", count=count))


def test_a_file_that_was_never_closed_is_read_to_its_end(tmp_path):
    cloud, source = clouds.read_with_source(las(tmp_path / "a.las", count=0))
    assert cloud.xyz_m == pytest.approx(XYZ, abs=1e-9)
    assert "never closed" in source.notes[0]


def laz_of_one_chunk(path, xyz):
    """LAZ as LASzip 1 wrote it, in one chunk and without a table of chunks."""
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales = np.full(3, 1e-4)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    cloud.write(path)
    raw = bytearray(path.read_bytes())
    data_at = struct.unpack_from("<I", raw, 96)[0]
    record = raw.index(b"laszip encoded") - 2 + 54
    assert struct.unpack_from("<H", raw, record) == (2,)
    struct.pack_into("<H", raw, record, 1)
    table_at = struct.unpack_from("<q", raw, data_at)[0]
    path.write_bytes(raw[:data_at] + raw[data_at + 8 : table_at])
    return path


def test_old_laz_without_a_table_of_chunks_is_read(tmp_path, capfd):
    found = clouds.read(laz_of_one_chunk(tmp_path / "a.laz", XYZ))
    assert found.xyz_m == pytest.approx(XYZ, abs=1e-9)
    assert "panicked" not in capfd.readouterr().err


@pytest.mark.parametrize("at", [0.5, 0.9])
def test_garbage_in_a_laz_is_one_error_without_a_stack_of_another_language(tmp_path, capfd, at):
    clouds.write(tmp_path / "a.laz", clouds.Cloud(XYZ))
    raw = bytearray((tmp_path / "a.laz").read_bytes())
    start = int(at * len(raw))
    raw[start : start + 200] = b"\xff" * 200
    (tmp_path / "a.laz").write_bytes(raw)
    with pytest.raises(InputError, match=r"a\.laz: found "):
        clouds.read(tmp_path / "a.laz")
    assert "panicked" not in capfd.readouterr().err


def with_crs(path, crs, factor):
    clouds.write(path, clouds.Cloud(XYZ * factor, np.array([0.0, 0.0, 0.0])), crs=crs, scale_m=1e-7)
    return path


@pytest.mark.parametrize(
    ("crs", "metres"),
    [("EPSG:2263", 1200 / 3937), ("EPSG:2222", 0.3048), ("EPSG:2263+6360", 1200 / 3937)],
)
def test_feet_become_metres_with_a_word(tmp_path, crs, metres):
    path = with_crs(tmp_path / "a.laz", crs, 1 / metres)
    cloud, source = selection.take(*clouds.read_with_source(path), path)
    assert cloud.world_xyz_m == pytest.approx(XYZ, abs=1e-6)
    assert "turned into metres" in " ".join(source.notes)


def test_degrees_are_refused_with_the_command_that_reprojects(tmp_path):
    place = np.array([7.8, 48.0, 0.0])
    path = with_crs(tmp_path / "a.laz", "EPSG:4326", np.array([1e-5, 1e-5, 1.0]))
    cloud, source = clouds.read_with_source(path)
    moved = clouds.Cloud(cloud.xyz_m, place)
    with pytest.raises(InputError, match=r"longitudes and latitudes .*EPSG:32632"):
        selection.take(moved, source, path)


def test_noise_withheld_and_synthetic_points_are_dropped_and_counted(tmp_path):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, 1e-4)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = XYZ.T
    cloud.classification[:30] = 7
    cloud.classification[30:50] = 18
    cloud.withheld[50:150] = 1
    cloud.synthetic[150:160] = 1
    cloud.write(tmp_path / "a.las")
    found = clouds.read_with_source(tmp_path / "a.las")
    kept, source = selection.take(*found, tmp_path / "a.las")
    assert len(kept) == 240
    assert source.left_out == {"classified as noise": 50, "withheld": 100, "synthetic": 10}
    assert not {"Withheld", "Synthetic"} & set(kept.attributes)


def test_an_attribute_that_cannot_be_kept_is_left_out_with_a_note_and_stops_nothing():
    attributes = {
        "Classification": np.array([-1, 1]),
        "ReturnNumber": np.array([1.5, 2.0]),
        "Reflectance": np.array([-3.0, np.nan]),
        "label": np.array([-1, 300]),
    }
    kept, notes = selection.storable(attributes)
    assert list(kept) == ["Reflectance"]
    assert [note.split(" is ")[0] for note in notes] == ["Classification", "ReturnNumber"]


@pytest.mark.parametrize("bounds", [[0.0] * 6, [1e30, -1e30] * 3, [-9.0, 9.0] * 3, [np.nan] * 6])
@pytest.mark.parametrize("corner_m", [(0.0, 0.0, 0.0), (512_345.0, 5_332_918.0, 420.0)])
def test_bounds_in_a_header_may_be_wrong(tmp_path, bounds, corner_m):
    corner_m = np.array(corner_m)
    path = las(tmp_path / "a.las", xyz=XYZ + corner_m, scale=0.01)
    head = bytearray(path.read_bytes())
    struct.pack_into("<6d", head, 179, *bounds)
    path.write_bytes(head)
    found = clouds.read(path)
    assert found.world_xyz_m == pytest.approx(XYZ + corner_m, abs=0.006)
    assert np.abs(found.xyz_m).max() < 1000  # near the local origin


# --- E57 ------------------------------------------------------------------------------------


def e57(path, scans, **more):
    with pye57.E57(str(path), mode="w") as file:
        for xyz, position in scans:
            data = {f"cartesian{axis}": xyz[:, k].copy() for k, axis in enumerate("XYZ")}
            data |= {name: values.copy() for name, values in more.items()}
            file.write_scan_raw(data, translation=np.asarray(position, float))
    return path


def test_points_at_the_scanner_s_own_place_are_shots_that_met_nothing(tmp_path):
    position = np.array([6.0, -1.0, 1.6])
    local = np.concatenate([XYZ - position, np.zeros((90, 3))])
    path = e57(tmp_path / "a.e57", [(local, position), (XYZ - position, position)])
    cloud, source = clouds.read_with_source(path)
    assert len(cloud) == 800
    assert source.left_out == {AT_SCANNER: 90}
    assert [scan.points for scan in source.scans] == [400, 400]


def e57_with_colours(path, most, colour):
    """A scan whose colours go up to `most`, written by libE57 itself: pye57 writes 8 bits only."""
    imf = pye57.E57(str(path), mode="w")
    scan = libe57.StructureNode(imf.image_file)
    scan.set("guid", libe57.StringNode(imf.image_file, "{1}"))
    prototype = libe57.StructureNode(imf.image_file)
    values = {f"cartesian{axis}": XYZ[:, k].copy() for k, axis in enumerate("XYZ")}
    for name in values:
        prototype.set(name, libe57.FloatNode(imf.image_file, 0.0, libe57.E57_DOUBLE, -100, 100))
    for name in ("colorRed", "colorGreen", "colorBlue"):
        prototype.set(name, libe57.IntegerNode(imf.image_file, 0, 0, most))
        values[name] = np.full(len(XYZ), float(colour))
    points = libe57.CompressedVectorNode(
        imf.image_file, prototype, libe57.VectorNode(imf.image_file, True)
    )
    scan.set("points", points)
    imf.data3d.append(scan)
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in values.items():
        buffers.append(
            libe57.SourceDestBuffer(imf.image_file, name, column, len(column), True, True)
        )
    writer = points.writer(buffers)
    writer.write(len(XYZ))
    writer.close()
    imf.close()
    return path


@pytest.mark.parametrize(("most", "colour", "kind"), [(255, 200, "u1"), (65535, 40000, "u2")])
def test_colours_of_an_e57_may_have_16_bits(tmp_path, most, colour, kind):
    found = clouds.read(e57_with_colours(tmp_path / "a.e57", most, colour))
    assert found.xyz_m == pytest.approx(XYZ)
    assert found.attributes["Green"].dtype == np.dtype(kind)
    assert set(found.attributes["Green"]) == {colour}


# --- PLY ------------------------------------------------------------------------------------

ROWS = "1 2 3 2 0.1 0.2\n4 5 6 2 0.3 0.4\n"


def ply_text(properties, rows, before=""):
    lines = ["ply", "format ascii 1.0", *before.splitlines(), "element vertex 2", *properties]
    return "\n".join([*lines, "end_header"]) + "\n" + rows


AXES = [f"property float {axis}" for axis in "xyz"]


@pytest.mark.parametrize(
    "text",
    [
        ply_text([*AXES, "property list uchar float descriptor"], ROWS),
        ply_text(["property list uchar float d", *AXES], "1 9 1 2 3\n2 8 9 4 5 6\n"),
        ply_text(
            AXES,
            "0.5 0.5\n1 2 3\n4 5 6\n",
            "element camera 1\nproperty float vx\nproperty float vy",
        ),
        ply_text(AXES, "2 0 1\n1 2 3\n4 5 6\n", "element edge 1\nproperty list uchar int v"),
        ply_text(AXES, "1 2 3\n4 5 6\n", "comment made by\nobj_info width 2"),
        ply_text(AXES, "\n 1  2 3\n\n4 5 6\n"),
        ply_text([*AXES, "property uint64 id"], "1 2 3 7\n4 5 6 8\n"),
        ply_text(AXES, "1 2 3\n4 5 6\n").replace("vertex", "points"),
    ],
    ids=[
        "list behind",
        "list before, of any length",
        "element before",
        "list element before",
        "obj_info",
        "empty lines",
        "whole numbers of 64 bits",
        "vertices called points",
    ],
)
def test_lists_and_other_elements_of_a_ply_are_passed_over(tmp_path, text):
    (tmp_path / "a.ply").write_text(text)
    assert clouds.read(tmp_path / "a.ply").xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("lengths", [(2, 2), (0, 3)])
def test_binary_lists_of_a_ply_are_passed_over(tmp_path, order, lengths):
    name = {"<": "little", ">": "big"}[order]
    head = ["ply", f"format binary_{name}_endian 1.0", "element vertex 2", "property double x"]
    head += ["property list uint short d", "property double y", "property double z", "end_header"]
    body = b""
    for k, length in enumerate(lengths):
        body += struct.pack(
            f"{order}dI{length}h2d", 3 * k + 1, length, *[9] * length, 3 * k + 2, 3 * k + 3
        )
    (tmp_path / "a.ply").write_bytes("\n".join([*head, ""]).encode() + body)
    assert clouds.read(tmp_path / "a.ply").xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]


def ray_cloud(path, start, end, met):
    head = ["ply", "format binary_little_endian 1.0", "comment rays", f"element vertex {len(end)}"]
    head += [
        f"property {kind} {name}"
        for kind, name in zip(
            ["double"] * 4 + ["float"] * 3 + ["uchar"] * 4,
            ["x", "y", "z", "time", "nx", "ny", "nz", "red", "green", "blue", "alpha"],
            strict=True,
        )
    ]
    table = np.zeros(len(end), [("xyzt", "<f8", 4), ("n", "<f4", 3), ("c", "u1", 4)])
    table["xyzt"][:, :3], table["n"] = end, start - end
    table["c"][:, 3] = np.where(met, 255, 0)
    path.write_bytes("\n".join([*head, "end_header", ""]).encode() + table.tobytes())
    return path


def test_rays_that_met_nothing_are_no_points_but_shots(tmp_path):
    met = np.arange(400) % 4 > 0
    start = np.array([1.0, 2.0, 1.5]) + np.zeros((400, 3))
    path = ray_cloud(tmp_path / "a.ply", start, XYZ, met)
    cloud, source = clouds.read_with_source(path)
    assert cloud.xyz_m == pytest.approx(XYZ[met])
    assert source.left_out == {MISSED: 100}
    fired = clouds.fired(path)
    assert fired.origin_m == pytest.approx(start, abs=1e-5)
    assert np.array_equal(np.diff(fired.first), met)
    assert fired.return_xyz_m == pytest.approx(XYZ[met], abs=1e-5)


def test_axes_of_a_ply_may_be_in_capitals(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 1\n"
    axes = "".join(f"property float {axis}\n" for axis in "XYZ")
    (tmp_path / "a.ply").write_text(f"{head}{axes}end_header\n1 2 3\n")
    assert clouds.read(tmp_path / "a.ply").xyz_m.tolist() == [[1, 2, 3]]


def test_a_cloud_with_normals_and_colours_is_no_ray_cloud(tmp_path):
    unit = np.tile([0.0, 0.6, 0.8], (400, 1))
    path = ray_cloud(tmp_path / "a.ply", XYZ + unit, XYZ, np.zeros(400, bool))
    assert len(clouds.read(path)) == 400
    assert clouds.fired(path) is None


# --- text -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "attributes"),
    [
        ("//X;Y;Z;Reflectance\n2\n1;2;3;-4\n4;5;6;-5\n", ["Reflectance"]),
        ("//X Y Z Reflectance\n2\n1 2 3 -4\n4 5 6 -5\n", ["Reflectance"]),
        (
            "X[m],Y[m],Z[m],Reflectance[dB],Deviation[]\n1,2,3,-4,5\n4,5,6,-5,6\n",
            ["Reflectance", "Deviation"],
        ),
        ("X (m)\tY (m)\tZ (m)\n1\t2\t3\n4\t5\t6\n", []),
        ("\ufeffX;Y;Z;Reflectance\r\n1,0;2,0;3,0;-4,5\r\n4,0;5,0;6,0;-5\r\n", ["Reflectance"]),
        ("1,0 2,0 3,0\n4,0 5,0 6,0\n", []),
        ("Easting,Northing,Elevation\n1,2,3\n4,5,6\n", []),
        ("Exported 2024\n\nx_m y_m z_m\n1 2 3\n4 5 6\n", []),
        ("X,Y,Z,\n1,2,3,\n4,5,6,\n", []),
        ("X Y Z Intensity\n1.0 2.0 3.0 NaN\n4 5 6 7\n", ["Intensity"]),
        ("% x y z\n1e0 2e0 3e0\n4 5 6\n", []),
        ('"Points:0","Points:1","Points:2","Reflectance"\n1,2,3,-4\n4,5,6,-5\n', ["Reflectance"]),
        ("FID,POINT_X,POINT_Y,POINT_Z\n0,1,2,3\n1,4,5,6\n", ["FID"]),
        ("coord. X;coord. Y;coord. Z\n1;2;3\n4;5;6\n", []),
        ("xcoord,ycoord,zcoord\n1,2,3\n4,5,6\n", []),
        ("Nordwert;Ostwert;Höhe\n2,0;1,0;3,0\n5,0;4,0;6,0\n", []),
        ("east,north,up\n1,2,3\n4,5,6\n", []),
        ("height,x,y,z\n9,1,2,3\n9,4,5,6\n", ["height"]),
        ('"X","Y","Z"\n"1,0","2,0","3,0"\n"4,0","5,0","6,0"\n', []),
        ("x|y|z\n1|2|3\n4|5|6\n", []),
    ],
)
def test_text_is_read_as_other_programs_write_it(tmp_path, text, attributes):
    (tmp_path / "a.txt").write_bytes(text.encode())
    found = clouds.read(tmp_path / "a.txt")
    assert found.xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    expected = ["RelativeIntensity" if a == "Intensity" else a for a in attributes]
    assert list(found.attributes) == expected


def test_rows_and_columns_of_a_scan_before_the_coordinates_are_told_from_them(tmp_path):
    grid = np.argwhere(np.ones((20, 20)))
    rows = np.column_stack([grid, XYZ, np.arange(400)])
    np.savetxt(tmp_path / "a.xyz", rows, fmt=["%d", "%d", "%.4f", "%.4f", "%.4f", "%d"])
    found, source = clouds.read_with_source(tmp_path / "a.xyz")
    assert found.xyz_m == pytest.approx(XYZ)
    assert "rows and columns" in source.notes[0]
    np.savetxt(tmp_path / "b.xyz", rows[:, [2, 3, 4, 0, 1, 5]], fmt="%.4f")
    assert clouds.read(tmp_path / "b.xyz").xyz_m == pytest.approx(XYZ)


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1", "utf-8-sig"])
def test_text_may_have_any_encoding(tmp_path, encoding):
    (tmp_path / "a.csv").write_bytes("X;Y;Z;Höhe über Grund\n1;2;3;4\n4;5;6;7\n".encode(encoding))
    found = clouds.read(tmp_path / "a.csv")
    assert found.xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(found.attributes) == ["Höhe über Grund"]


@pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("ft", 0.3048)])
def test_units_in_a_header_are_turned_into_metres_with_a_word(tmp_path, unit, metres):
    (tmp_path / "a.txt").write_text(f"X[{unit}] Y[{unit}] Z[{unit}]\n1000 2000 3000\n1 2 3\n")
    cloud, source = clouds.read_with_source(tmp_path / "a.txt")
    assert cloud.xyz_m[0] == pytest.approx(np.array([1000, 2000, 3000]) * metres)
    assert len(source.notes) == 3


def test_coordinates_from_the_centre_of_the_earth_are_refused(tmp_path):
    path = with_crs(tmp_path / "a.laz", "EPSG:4978", 1.0)
    with pytest.raises(InputError, match=r"from the centre of the earth .*out_srs"):
        selection.take(*clouds.read_with_source(path), path)


@pytest.mark.parametrize(("row", "metres"), [("[m] [m] [m]", 1.0), ("mm mm mm", 1e-3)])
def test_a_row_of_units_below_the_header_is_no_header(tmp_path, row, metres):
    rows = "\n".join(" ".join(map(str, point)) for point in XYZ)
    (tmp_path / "a.txt").write_text(f"Survey of May\nX Y Z\n{row}\n{rows}\n")
    assert clouds.read(tmp_path / "a.txt").xyz_m == pytest.approx(XYZ * metres, abs=1e-9)


def test_a_file_of_another_format_than_its_name_says_is_told_so(tmp_path):
    path = las(tmp_path / "a.las").rename(tmp_path / "a.txt")
    with pytest.raises(InputError, match=r"begins as LAS or LAZ does.*end in \.laz"):
        clouds.read(path)


@pytest.mark.parametrize("name", ["a.xyz.gz", "a.xyz", "a.laz"])
def test_a_packed_file_is_told_to_be_unpacked(tmp_path, name):
    (tmp_path / name).write_bytes(gzip.compress(b"X Y Z\n1 2 3\n"))
    with pytest.raises(InputError, match=r"a gzip archive.*Unpack it first"):
        clouds.read(tmp_path / name)


@pytest.mark.parametrize("suffix", [".pts", ".xyz"])
def test_fewer_points_than_a_text_announces_are_told(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_text("4\n1 2 3 7\n4 5 6 7\n7 8 9 7\n")
    cloud, source = clouds.read_with_source(tmp_path / f"a{suffix}")
    assert len(cloud) == 3
    assert "announces 4 points and holds 3" in " ".join(source.notes)


def test_several_scans_in_one_pts_file_are_told_apart(tmp_path):
    (tmp_path / "a.pts").write_text("2\n1 2 3 -500 9 8 7\n4 5 6 -499 9 8 7\n1\n7 8 9 -498 9 8 7\n")
    cloud, source = clouds.read_with_source(tmp_path / "a.pts")
    assert cloud.xyz_m.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert cloud.attributes["PointSourceId"].tolist() == [1, 1, 2]
    assert cloud.attributes["Blue"].tolist() == [7, 7, 7]
    assert [scan.points for scan in source.scans] == [2, 1]


def test_a_row_without_all_coordinates_is_no_count_of_points(tmp_path):
    (tmp_path / "a.xyz").write_text("1 2 3\n7\n4 5 6\n")
    with pytest.raises(InputError, match="1 points with coordinates that are no numbers"):
        clouds.read(tmp_path / "a.xyz")


def test_a_column_of_text_is_left_out_with_a_note(tmp_path):
    (tmp_path / "a.csv").write_text("X,Y,Z,species\n1,2,3,oak\n4,5,6,ash\n")
    cloud, source = clouds.read_with_source(tmp_path / "a.csv")
    assert not cloud.attributes
    assert "species" in source.notes[0]
    assert "'oak' in data row 1" in source.notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("A B C\n1 2 3\n4 5 6\n", "the columns 'A B C'"),
        ("this is a letter\nabout a cloud\n", "no row of numbers"),
        ("X Y\n1 2\n3 4\n", "no row of numbers"),
        ("X;Y;Z\n4,321,000.12;5,332,000.1;1.5\n", "no row of numbers: .*4,321,000.12"),
    ],
)
def test_a_text_that_is_no_table_of_points_is_refused(tmp_path, text, message):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        clouds.read(tmp_path / "a.txt")


def test_a_header_without_rows_has_no_points(tmp_path):
    (tmp_path / "a.txt").write_text("X Y Z\n")
    with pytest.raises(EmptyCloudError):
        clouds.read(tmp_path / "a.txt")


# --- PTX ------------------------------------------------------------------------------------


def test_a_ptx_that_claims_more_shots_than_fit_is_refused_before_memory_is_taken(tmp_path):
    head = "1000000\n1000000\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    (tmp_path / "a.ptx").write_text(head + "0 0 0 0.5\n" * 100)
    with pytest.raises(InputError, match=r"1,000,000 × 1,000,000 shots in the header of scan 1"):
        clouds.read(tmp_path / "a.ptx")


# --- PCD ------------------------------------------------------------------------------------


def pcd(path, xyz, kind="binary", points=None, size=8):
    """Points with an intensity, as the Point Cloud Library writes them."""
    header = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE {size} {size} {size} 4\n"
        f"TYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {len(xyz)}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(xyz) if points is None else points}\nDATA {kind}\n"
    )
    if kind == "ascii":
        body = "".join(f"{x:.4f} {y:.4f} {z:.4f} 0.5\n" for x, y, z in xyz).encode()
    else:
        rows = np.zeros(len(xyz), [(n, f"<f{size}") for n in "xyz"] + [("intensity", "<f4")])
        for k, name in enumerate("xyz"):
            rows[name] = xyz[:, k]
        rows["intensity"] = 0.5
        body = rows.tobytes()
    path.write_bytes(header.encode() + body)
    return path


@pytest.mark.parametrize("kind", ["ascii", "binary"])
def test_pcd_is_read_and_its_empty_points_are_shots_that_met_nothing(tmp_path, kind):
    given = XYZ.copy()
    given[7] = np.nan
    cloud, source = clouds.read_with_source(pcd(tmp_path / "a.pcd", given, kind))
    assert cloud.world_xyz_m == pytest.approx(np.delete(XYZ, 7, axis=0), abs=1e-9)
    assert dict(source.left_out) == {MISSED: 1}
    assert len(cloud.attributes["RelativeIntensity"]) == 399


def test_pcd_that_lost_its_millimetres_claims_too_much_or_is_compressed_is_refused(tmp_path):
    with pytest.raises(InputError, match="32-bit floats"):
        clouds.read(pcd(tmp_path / "a.pcd", XYZ + np.array([5e5, 5.3e6, 0.0]), size=4))
    with pytest.raises(InputError, match="1000000000 points in"):
        clouds.read(pcd(tmp_path / "b.pcd", XYZ, points=10**9))
    with pytest.raises(InputError, match="pcl_convert_pcd_ascii_binary"):
        clouds.read(pcd(tmp_path / "c.pcd", XYZ, "binary_compressed"))
    (tmp_path / "d.pcd").write_text("VERSION 0.7\n")
    with pytest.raises(InputError, match="no header of a PCD file"):
        clouds.read(tmp_path / "d.pcd")
