import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats.ground_surface import GroundSurface, flat
from dapple.formats.meshes import Mesh
from dapple.scene import sensors
from dapple.scene.facing import facing_of
from dapple.scene.surfaces import of_kinds


def leaf(z_m=2.0, side_m=0.05):
    corners = np.array([[0, 0, z_m], [side_m, 0, z_m], [side_m, side_m, z_m], [0, side_m, z_m]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(corners.astype(float), faces, np.zeros(2, np.int32))


def at(*point):
    table = sensors.grid_around((0.0, 0.0), 1, 1, 1.0, 0.0)
    table.loc[0, sensors.POSITION] = point
    return table


def table(tmp_path, text):
    path = tmp_path / "sensors.csv"
    path.write_text(text)
    return path


def test_positions_become_local_and_keep_their_millimetres(tmp_path):
    path = table(
        tmp_path,
        '"","label","X","Y","Z"\n"1","1_1",410508.15725,5317096.0095,288.6835\n'
        '"4","1_2",410509.1255,5317095.82225,288.68\n',
    )
    read = sensors.read(path, (410500.0, 5317090.0, 280.0))
    assert list(read["sensor"]) == ["1_1", "1_2"]
    assert read.loc[0, sensors.POSITION].to_numpy(float) == pytest.approx(
        [8.15725, 6.0095, 8.6835], abs=1e-7
    )


def test_a_plain_table_is_read_as_well_and_labels_stay_text(tmp_path):
    read = sensors.read(table(tmp_path, "sensor,x_m,y_m,z_m\n007,1,2,3\n"))
    assert read["sensor"].iloc[0] == "007"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("label,X,Y,Z\n1_1,1,2,3\n1_1,2,2,3\n", "sensor 1_1 more than once"),
        ("label,X,Y,Z\n1_1,1,,3\n", r"sensor 1_1 at \(1, , 3\)"),
        ("label,X,Y,Z\n1_1,1,east,3\n", "line 2: found 'east'"),
        ("label,X,Y,Z\n1_1,1,inf,3\n", "expected three numbers"),
        ("label,X,Y,Z\n,1,2,3\n", "without a label"),
        ("label,X,Y\n1_1,1,2\n", "a column z_m or z"),
        ("label,X,Y,Z\n", "no sensors"),
        ("label,X,Y,Z,tilt_deg\n1_1,1,2,3,30\n", "azimuth_deg nan of sensor 1_1"),
        ("label,X,Y,Z,tilt,azimuth\n1_1,1,2,3,200,0\n", "tilt_deg 200 of sensor 1_1"),
        ("label,X,Y,Z,tilt,azimuth\n1_1,1,2,3,20,-90\n", "azimuth_deg -90 of sensor 1_1"),
        ("label,X,Y,Z,calibration\n1_1,1,2,3,0\n", "calibration 0 of sensor 1_1"),
    ],
)
def test_a_broken_table_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        sensors.read(table(tmp_path, text))


def test_a_row_that_stands_there_twice_is_read_once_with_a_word(tmp_path, capsys):
    read = sensors.read(table(tmp_path, "label,X,Y,Z\na,1,2,3\nb,1,2,4\na,1,2,3\n"))
    assert list(read["sensor"]) == ["a", "b"]
    assert "1 rows twice, read once" in capsys.readouterr().out


def test_tilted_sensors_face_where_their_columns_say_and_level_ones_need_no_azimuth(tmp_path):
    text = "label,X,Y,Z,tilt_deg,azimuth_deg\na,1,2,3,0,\nb,1,2,3,90,90\nc,1,2,3,30,180\n"
    found = facing_of(sensors.read(table(tmp_path, text)))
    half = 0.5, np.sqrt(0.75)
    expected = np.array([[0, 0, 1], [1, 0, 0], [0, -half[0], half[1]]])
    assert found == pytest.approx(expected, abs=1e-12)


def test_level_sensors_carry_no_angles(tmp_path):
    read = sensors.read(table(tmp_path, "label,X,Y,Z,tilt_deg\na,1,2,3,0\n"))
    assert list(read) == ["sensor", *sensors.POSITION]
    assert facing_of(read) is None


def test_angles_of_the_configuration_hold_where_the_table_has_none(tmp_path):
    path = table(tmp_path, "label,X,Y,Z,tilt\na,1,2,3,20\n")
    read = sensors.read(path, tilt_deg=45.0, azimuth_deg=270.0)
    assert read[["tilt_deg", "azimuth_deg"]].to_numpy().tolist() == [[20.0, 270.0]]


def test_heights_above_the_ground_follow_a_slope_and_leave_the_height_of_the_origin_alone(tmp_path):
    path = table(tmp_path, "label,X,Y,Z\na,500010,20,0.5\nb,500000,20,0.5\n")
    read = sensors.read(path, (500000.0, 0.0, 300.0), heights="above_ground")
    slope = GroundSurface(
        np.array([0.0, 20.0]), np.array([0.0, 40.0]), np.array([[0.0, 2.0], [0.0, 2.0]])
    )
    assert sensors.on_ground(read, slope)["z_m"].to_numpy() == pytest.approx([1.5, 0.5])


def test_a_missing_table_is_refused(tmp_path):
    with pytest.raises(InputError, match="no file"):
        sensors.read(tmp_path / "none.csv")


def test_a_grid_is_centred_where_it_should_be():
    grid = sensors.grid_around(
        (0.1, 0.25), columns=5, rows=2, spacing_m=0.5, height_m=0.1, ground=flat(3.0)
    )
    assert len(grid) == 5 * 2
    assert sorted(set(grid["x_m"].round(6))) == [-0.9, -0.4, 0.1, 0.6, 1.1]
    assert sorted(set(grid["y_m"])) == [0.0, 0.5]
    assert set(grid["z_m"]) == {3.1}
    assert not grid["sensor"].duplicated().any()
    assert grid["sensor"].iloc[[0, 4, 9]].tolist() == ["1_1", "1_5", "2_5"]


def test_the_distance_to_a_triangle_is_that_to_its_face_edge_or_corner():
    triangle = Mesh(
        np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]),
        np.array([[0, 1, 2]], np.int32),
        np.zeros(1, np.int32),
    )
    points = np.array(
        [[1, 1, 2], [1, 1, -2], [1.5, -3, 0], [-3, -4, 0], [6, 0, 4], [1.5 + 0.8, 2 + 0.6, 0]]
    )
    expected = [2, 2, 3, 5, 5, 1]  # face, face, edge, corner, corner, the slanted edge
    assert sensors.surface_distance(points, triangle, 10.0) == pytest.approx(expected)
    assert np.isinf(sensors.surface_distance(points, triangle, 0.5)).all()


def test_distances_agree_with_a_dense_sampling_of_the_triangles():
    rng = np.random.default_rng(2)
    mesh = Mesh(
        rng.normal(size=(30, 3)),
        np.arange(30, dtype=np.int32).reshape(10, 3),
        np.arange(10, dtype=np.int32),
    )
    points = rng.normal(size=(15, 3))
    u, v = np.meshgrid(np.linspace(0, 1, 150), np.linspace(0, 1, 150))
    u, v = u[u + v <= 1], v[u + v <= 1]
    a, b, c = (mesh.vertices_m[mesh.faces[:, k]][:, None] for k in range(3))
    dense = (a + u[:, None] * (b - a) + v[:, None] * (c - a)).reshape(-1, 3)
    brute = np.array([np.linalg.norm(dense - p, axis=1).min() for p in points])
    assert sensors.surface_distance(points, mesh, 100.0) == pytest.approx(brute, abs=0.02)


def test_a_sensor_under_a_leaf_is_fine_and_one_inside_it_is_named_with_its_distance():
    sensors.check(at(0.02, 0.02, 1.9), of_kinds(leaf=leaf()))
    with pytest.raises(InputError, match=r"sensor 1_1 3\.0 mm from leaf"):
        sensors.check(at(0.02, 0.02, 1.997), of_kinds(leaf=leaf()))
    with pytest.raises(InputError, match="from wood"):
        sensors.check(at(0.02, 0.02, 2.0), of_kinds(leaf=leaf(5.0), wood=leaf()))


def test_a_sensor_far_outside_the_scene_is_named_with_its_distance():
    with pytest.raises(InputError, match=r"sensor 1_1 at .*, 99\.9 m outside the scene"):
        sensors.check(at(99.95, 0.0, 2.0), of_kinds(leaf=leaf()))
    sensors.check(
        at(99.95, 0.0, 2.0), of_kinds(leaf=leaf()), bounds_m=np.array([[0, 0, 0], [90, 9, 9]])
    )


def test_a_sensor_below_the_ground_is_refused():
    with pytest.raises(InputError, match=r"0\.100 m below the ground"):
        sensors.check(at(0.0, 0.0, 0.4), of_kinds(leaf=leaf()), ground=flat(0.5))


def test_an_open_field_takes_sensors_anywhere():
    sensors.check(at(500.0, 0.0, 1.0))
