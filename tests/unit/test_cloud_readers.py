"""E57, PLY, PTX and PCD as other programs write them: read whole, or refused in one message."""

import struct

import numpy as np
import pye57
import pytest
from pye57 import libe57
from tests.unit.test_las_readers import XYZ

from dapple.errors import InputError
from dapple.formats import clouds
from dapple.formats.cloud_raw import AT_SCANNER, MISSED

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
