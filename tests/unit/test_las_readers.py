"""LAS and LAZ as other programs write them: read whole, or refused in one message."""

import resource
import struct
import time

import laspy
import numpy as np
import pytest

from dapple.cloud import selection
from dapple.errors import InputError
from dapple.formats import clouds

XYZ = np.round(np.random.default_rng(4).uniform(-2, 9, (400, 3)), 4)


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
