"""A UAV's scanner: density, geometry and returns of pulses over worlds of known shape."""

import laspy
import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats import clouds
from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh
from dapple.virtual import uav_scanner
from dapple.virtual.uav_scanner import Flight

LOW, HIGH = (0.0, 0.0), (12.0, 10.0)
ORIGIN = np.array([612_000.0, 5_324_000.0, 640.0])


def plate(z_m, low=(-60.0, -60.0), high=(70.0, 70.0)):
    x, y = np.transpose([low, high])
    vertices = np.array(
        [[x[0], y[0], z_m], [x[1], y[0], z_m], [x[1], y[1], z_m], [x[0], y[1], z_m]]
    )
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def slats(z_m, width_m=0.03):
    """Narrow strips with gaps as wide as they are."""
    strips = [plate(z_m, (x, -60.0), (x + width_m, 70.0)) for x in np.arange(-5, 17, 2 * width_m)]
    n = len(strips)
    vertices = np.concatenate([strip.vertices_m for strip in strips])
    faces = np.concatenate([strip.faces + 4 * k for k, strip in enumerate(strips)])
    return Mesh(vertices, faces, np.repeat(np.arange(n, dtype=np.int32), 2))


def flown(meshes, **changes):
    flight = Flight(**{"reflectance_sd_db": 0.0, "pulses_per_m2": 300.0} | changes)
    parts = list(
        uav_scanner.scan(
            meshes, flight, low_m=LOW, high_m=HIGH, ground_z_m=0.0, origin_m=ORIGIN, seed=1
        )
    )
    names = parts[0].attributes
    return Cloud(
        np.concatenate([part.xyz_m for part in parts]),
        parts[0].origin_m,
        {name: np.concatenate([part.attributes[name] for part in parts]) for name in names},
    )


@pytest.fixture(scope="module")
def bare():
    return flown({"ground": plate(0.0)})


@pytest.fixture(scope="module")
def layered():
    return flown({"leaf": slats(8.0), "ground": plate(0.0)})


def test_level_ground_gets_the_pulses_asked_for_everywhere(bare):
    density = np.histogram2d(*bare.xyz_m[:, :2].T, bins=(3, 2))[0] / 20.0
    np.testing.assert_allclose(density, 300.0, rtol=0.05)


def test_points_lie_on_the_ground_within_the_noise_of_range(bare):
    assert bare.xyz_m[:, 2].mean() == pytest.approx(0.0, abs=0.002)
    assert bare.xyz_m[:, 2].std() == pytest.approx(0.015, rel=0.15)


def test_no_point_lies_outside_the_area(bare):
    assert (bare.xyz_m[:, :2] >= LOW).all()
    assert (bare.xyz_m[:, :2] < HIGH).all()


def test_scan_angles_point_back_at_the_flight_line(bare):
    lines = uav_scanner.lines_m(Flight(), np.array(LOW), np.array(HIGH))
    number = bare.attributes["PointSourceId"].astype(int)
    north = np.where(number % 2, 1.0, -1.0)
    sideways = north * np.tan(np.radians(bare.attributes["ScanAngle"])) * 50.0
    np.testing.assert_allclose(bare.xyz_m[:, 0], lines[number - 1] + sideways, atol=0.1)


def test_lines_fly_to_and_fro_in_time(bare):
    number, time = bare.attributes["PointSourceId"], bare.attributes["GpsTime"]
    for line in np.unique(number):
        chosen = number == line
        slope = np.polyfit(time[chosen], bare.xyz_m[chosen, 1], 1)[0]
        assert slope == pytest.approx(5.0 if line % 2 else -5.0, rel=0.01)
    assert (np.diff([time[number == line].min() for line in np.unique(number)]) > 0).all()


def test_a_beam_on_slats_returns_from_them_and_from_the_ground(layered):
    number, total = (layered.attributes[name] for name in ("ReturnNumber", "NumberOfReturns"))
    assert total.max() == 2
    assert (number <= total).all()
    pairs = (total == 2) & (number == 1)
    assert pairs.mean() > 0.3
    np.testing.assert_allclose(layered.xyz_m[pairs, 2], 8.0, atol=0.1)
    assert (layered.attributes["Truth"][pairs] == 4).all()
    assert (layered.attributes["Truth"][(total == 2) & (number == 2)] == 2).all()


def test_the_slats_take_half_of_the_energy(layered):
    energy = layered.attributes["Intensity"] / uav_scanner.WHITE_INTENSITY
    leaf = layered.attributes["Truth"] == 4
    n = len(np.unique(layered.attributes["GpsTime"]))
    leaf_energy = (energy[leaf]).sum() * (42 / 50) ** 2 / n / 0.45
    ground_energy = energy[~leaf].sum() / n / 0.3
    # Both fall off the vertical by the same cosines, so that their ratio tells the shares.
    assert leaf_energy / (leaf_energy + ground_energy) == pytest.approx(0.5, abs=0.05)


def test_intensity_falls_with_the_cosine_of_incidence_and_the_square_of_range(bare):
    cosine = np.cos(np.radians(bare.attributes["ScanAngle"]))
    expected = 0.3 * uav_scanner.WHITE_INTENSITY * cosine**3
    for part in (cosine > 0.97, cosine < 0.9):
        ratio = bare.attributes["Intensity"][part] / expected[part]
        assert np.median(ratio) == pytest.approx(1.0, abs=0.02)


def test_the_same_seed_gives_the_same_bytes(bare):
    again = flown({"ground": plate(0.0)})
    assert again.xyz_m.tobytes() == bare.xyz_m.tobytes()
    assert again.attributes["Intensity"].tobytes() == bare.attributes["Intensity"].tobytes()


def test_laz_keeps_place_angle_time_and_coordinate_system(bare, tmp_path):
    path = tmp_path / "lidar.laz"
    some = bare.select(slice(0, 500))
    clouds.write(path, some, scale_m=0.001, crs="EPSG:25832")
    again = clouds.read(path)
    np.testing.assert_array_equal(again.origin_m, ORIGIN)
    np.testing.assert_allclose(again.xyz_m, some.xyz_m, atol=0.0006)
    np.testing.assert_allclose(
        again.attributes["ScanAngle"], some.attributes["ScanAngle"], atol=0.0031
    )
    np.testing.assert_array_equal(again.attributes["GpsTime"], some.attributes["GpsTime"])
    with laspy.open(path) as file:
        assert file.header.parse_crs().to_epsg() == 25832


def test_a_swath_that_leaves_gaps_is_refused():
    with pytest.raises(InputError, match="widen the swath"):
        flown({"ground": plate(0.0)}, half_swath_deg=5.0)
