"""North is y, azimuth turns clockwise, and a time without a zone is refused."""

import numpy as np
import pytest

from dapple import frames


@pytest.mark.parametrize(
    ("zenith_deg", "azimuth_deg", "vector"),
    [
        (90, 0, (0, 1, 0)),
        (90, 90, (1, 0, 0)),
        (90, 180, (0, -1, 0)),
        (90, 270, (-1, 0, 0)),
        (0, 123, (0, 0, 1)),
        (60, 90, (np.sqrt(3) / 2, 0, 0.5)),
    ],
)
def test_azimuth_runs_clockwise_from_north_and_zenith_from_above(zenith_deg, azimuth_deg, vector):
    assert frames.direction_from_angles(zenith_deg, azimuth_deg) == pytest.approx(vector, abs=1e-15)


def test_angles_and_directions_are_each_others_inverse():
    zenith, azimuth = np.meshgrid(np.linspace(1, 179, 30), np.linspace(0, 359, 40))
    back = frames.angles_from_direction(3.0 * frames.direction_from_angles(zenith, azimuth))
    assert back[0] == pytest.approx(zenith)
    assert back[1] == pytest.approx(azimuth)


def test_an_azimuth_is_always_below_360():
    _, azimuth = frames.angles_from_direction([[-1e-30, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert azimuth.tolist() == [0.0, 0.0]


def test_a_yawed_scanner_looks_counter_clockwise_from_east():
    looks_at = frames.scanner_rotation(0, 0, 90) @ [1, 0, 0]
    assert looks_at == pytest.approx([0, 1, 0], abs=1e-15)


def test_angles_of_a_scanner_come_back_from_its_rotation():
    angles = (10.0, -20.0, 140.0)
    found = frames.scanner_angles_deg(frames.scanner_rotation(*angles))
    assert found == pytest.approx(angles)


def test_roll_comes_first_then_pitch_then_yaw():
    from scipy.spatial.transform import Rotation

    angles = (10.0, -20.0, 140.0)
    expected = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    assert frames.scanner_rotation(*angles) == pytest.approx(expected)


def test_the_origin_is_floored_to_ten_metres_only_where_float32_is_too_coarse():
    xyz = np.array([[410505.3, 5317088.3, 288.7], [410512.0, 5317080.1, 295.0]])
    assert frames.choose_origin(xyz).tolist() == [410500.0, 5317080.0, 0.0]
    assert frames.choose_origin(xyz - xyz[0]).tolist() == [0.0, 0.0, 0.0]
    assert frames.choose_origin(-xyz).tolist() == [-410520.0, -5317090.0, 0.0]


def test_local_coordinates_keep_a_tenth_of_a_millimetre_in_float32():
    world = np.array([[410505.3123, 5317088.3456, 288.7001]])
    origin = frames.choose_origin(world)
    local = frames.to_local(world, origin).astype(np.float32)
    assert frames.to_world(local, origin) == pytest.approx(world, abs=1e-4)


def test_less_has_minus_east_up_north_and_dart_north_up_east():
    east_north_up = np.array([[1.0, 2.0, 3.0]])
    assert frames.local_to_less(east_north_up).tolist() == [[-1.0, 3.0, 2.0]]
    assert frames.local_to_dart(east_north_up).tolist() == [[2.0, 3.0, 1.0]]


@pytest.mark.parametrize(
    ("there", "back"),
    [
        (frames.local_to_less, frames.less_to_local),
        (frames.local_to_dart, frames.dart_to_local),
    ],
)
def test_axes_of_other_programs_are_rotations_so_that_faces_keep_their_side(there, back):
    xyz = np.random.default_rng(1).normal(size=(5, 3))
    assert back(there(xyz)) == pytest.approx(xyz)
    assert np.linalg.det(there(np.eye(3))) == pytest.approx(1.0)
