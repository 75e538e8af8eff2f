"""Text with points as other programs write it: read whole, or refused in one message."""

import gzip

import numpy as np
import pytest
from tests.unit.test_las_readers import XYZ, las, with_crs

from dapple.cloud import selection
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import clouds


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
