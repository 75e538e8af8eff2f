"""The virtual scanner sees walls, edges, gaps and foliage as geometry says it must."""

import drjit
import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.stats import kstest, norm

from dapple.errors import InputError
from dapple.formats.meshes import Mesh, concatenate
from dapple.virtual.scanner import positions_around, scan
from dapple.virtual.scanner_beam import beam_pattern
from dapple.virtual.scanner_window import grid_directions, through_box

HERE = np.zeros((1, 3))
STILL = {
    "range_noise_m": 0.0,
    "reflectance_noise_db": 0.0,
    "noise_points_per_shot": 0.0,
    "leaf_reflectance_db": (-8.0, 0.0),
    "wood_reflectance_db": (-3.0, 0.0),
    "incidence_exponent": 0.0,
    "clean_deviation": 0.0,
    "clean_deviation_sd": 0.0,
    "min_energy": 0.0,
    "window_margin_m": 0.0,
}
THIN = {"sub_rays": 1, "exit_aperture_m": 0.0, "beam_divergence_mrad": 0.0}


def rectangle(centre, half_a, half_b):
    a, b = np.asarray(half_a, float), np.asarray(half_b, float)
    vertices = np.asarray(centre, float) + np.array([-a - b, a - b, a + b, b - a])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def plate_to_the_north(y_m, x_low_m=-0.5, x_high_m=0.5):
    middle, half = 0.5 * (x_low_m + x_high_m), 0.5 * (x_high_m - x_low_m)
    return rectangle([middle, y_m, 0.0], [half, 0, 0], [0, 0, 0.5])


def around(y_low_m, y_high_m, half_width_m):
    half = half_width_m
    return np.array([-half, y_low_m, -half]), np.array([half, y_high_m, half])


def linear(db):
    return 10.0 ** (0.1 * np.asarray(db, float))


def test_a_wall_five_metres_away_is_five_metres_away():
    shots = scan(
        {"wood": plate_to_the_north(5.0)}, HERE, seed=1, angular_step_deg=0.2, **STILL, **THIN
    )
    assert (shots.n_returns == 1).mean() > 0.9
    np.testing.assert_allclose(shots.return_xyz_m[:, 1], 5.0, atol=2e-6)
    np.testing.assert_allclose(shots.reflectance_db, -3.0, atol=1e-5)
    assert set(shots.truth) == {0}


def test_range_noise_has_the_stated_standard_deviation_and_no_bias():
    options = {**STILL, "range_noise_m": 0.005}
    shots = scan({"wood": plate_to_the_north(5.0)}, HERE, seed=1, angular_step_deg=0.1, **options)
    hit = shots.shot_of_return
    error_m = shots.range_m - 5.0 / shots.direction[hit, 1]
    n = len(error_m)
    assert n > 5000
    assert error_m.std() == pytest.approx(0.005, rel=4 / np.sqrt(2 * n))
    assert abs(error_m.mean()) < 4 * 0.005 / np.sqrt(n)


def test_shots_past_the_wall_are_kept_as_misses():
    shots = scan(
        {"wood": plate_to_the_north(5.0)},
        HERE,
        seed=1,
        angular_step_deg=0.3,
        window_m=around(4.9, 5.1, 1.0),
        **STILL,
        **THIN,
    )
    x, z = 5.0 * shots.direction[:, [0, 2]].T / shots.direction[:, 1]
    meets = np.maximum(np.abs(x), np.abs(z)) < 0.5
    np.testing.assert_array_equal(shots.n_returns, meets)
    assert 0.2 < meets.mean() < 0.3
    assert np.maximum(np.abs(x), np.abs(z)).max() > 0.99


def test_a_shot_through_nothing_has_no_return():
    behind = rectangle([0, -5.0, 0], [0.5, 0, 0], [0, 0, 0.5])
    shots = scan(
        {"leaf": behind},
        HERE,
        seed=1,
        angular_step_deg=0.5,
        window_m=around(4, 6, 1.0),
        **STILL,
    )
    assert len(shots) > 500
    assert len(shots.range_m) == 0
    assert not shots.first.any()


def test_a_beam_on_an_edge_gives_two_returns_that_share_one_hits_energy():
    near = plate_to_the_north(5.0, x_low_m=-1.0, x_high_m=0.0)
    shots = scan(
        {"wood": concatenate([near, plate_to_the_north(8.0, -3.0, 3.0)])},
        HERE,
        seed=1,
        angular_step_deg=0.01,
        window_m=(np.array([-0.01, 5, -0.1]), np.array([0.01, 5.01, 0.1])),
        sub_rays=32,
        **STILL,
    )
    edge = np.flatnonzero(shots.n_returns == 2)
    assert len(edge) > 50
    front, back = shots.first[edge], shots.first[edge] + 1
    share = linear(shots.reflectance_db)
    np.testing.assert_allclose(share[front] + share[back], linear(-3.0), rtol=1e-5)
    along = shots.direction[edge, 1]
    np.testing.assert_allclose(shots.range_m[front] * along, 5.0, atol=2e-4)
    np.testing.assert_allclose(shots.range_m[back] * along, 8.0, atol=2e-4)
    central = np.abs(shots.direction[edge, 0]) < 1e-9
    assert share[front][central].mean() == pytest.approx(0.5 * linear(-3.0), rel=0.03)


def test_a_leaf_that_takes_part_of_the_beam_is_darker_by_that_part():
    leaf = plate_to_the_north(10.0, x_low_m=-1.0, x_high_m=0.0)
    shots = scan(
        {"leaf": leaf},
        HERE,
        seed=1,
        angular_step_deg=0.005,
        window_m=(np.array([-0.02, 10, -0.1]), np.array([0.02, 10.01, 0.1])),
        sub_rays=64,
        **STILL,
    )
    share = np.zeros(len(shots))
    share[shots.shot_of_return] = linear(shots.reflectance_db) / linear(-8.0)
    x_m = 10.0 * shots.direction[:, 0] / shots.direction[:, 1]
    radius_m = 0.5 * (0.007 + 0.00035 * 10.0)
    # a Gaussian beam: the share beyond a straight edge is a normal distribution function
    expected = norm.cdf(-x_m / (0.5 * radius_m))
    assert np.abs(share - expected).max() < 0.1
    assert np.abs(share - expected).mean() < 0.015


def test_targets_closer_than_the_pulse_merge_into_a_point_between_them():
    front = plate_to_the_north(5.0, x_low_m=-1.0, x_high_m=0.0)
    shots = scan(
        {"leaf": front, "wood": plate_to_the_north(5.3, -3.0, 3.0)},
        HERE,
        seed=1,
        angular_step_deg=0.01,
        window_m=(np.array([-0.01, 5, -0.1]), np.array([0.01, 5.01, 0.1])),
        **STILL,
    )
    assert (shots.n_returns == 1).all()
    y = shots.return_xyz_m[:, 1]
    mixed = (y > 5.0 + 1e-4) & (y < 5.3 - 1e-4)
    assert mixed.sum() > 50
    assert shots.deviation[mixed].min() >= 15
    assert shots.deviation[~mixed].max() == 0
    # 8 dB against 3 dB: the class with more energy is the one whose plate is nearer in range
    np.testing.assert_array_equal(shots.truth[mixed] == 0, y[mixed] > 5.15)


def test_a_lambertian_plate_at_60_degrees_returns_half():
    tilted = rectangle([0, 5.0, 0], [0.5, 0.5 * np.tan(np.radians(60)), 0], [0, 0, 0.5])
    options = {**STILL, "incidence_exponent": 1.0}
    shots = scan(
        {"wood": tilted},
        HERE,
        seed=1,
        angular_step_deg=0.05,
        window_m=around(4.9, 5.1, 0.02),
        **options,
        **THIN,
    )
    middle = np.argmax(shots.direction[:, 1])
    half_db = 10.0 * np.log10(0.5)
    assert shots.reflectance_db[shots.first[middle]] == pytest.approx(-3.0 + half_db, abs=1e-3)


def test_flat_ground_lies_where_it_is_said_to_lie():
    shots = scan(
        {"wood": plate_to_the_north(5.0)},
        HERE,
        seed=1,
        ground_z_m=-1.5,
        angular_step_deg=1.0,
        window_m=around(4.9, 5.1, 2.0),
        **STILL,
        **THIN,
    )
    ground = shots.truth == 2
    assert ground.any()
    np.testing.assert_allclose(shots.return_xyz_m[ground, 2], -1.5, atol=1e-5)
    down = shots.direction[:, 2] < -0.05
    assert (shots.n_returns[down] == 1).all()


def test_gaps_in_random_foliage_follow_beer_and_lambert():
    rng = np.random.default_rng(3)
    n, side_m = 60_000, 0.02
    low, high = np.array([-1.5, 5.0, -1.5]), np.array([1.5, 6.0, 1.5])
    normal, other = rng.normal(size=(2, n, 3))
    a = np.cross(normal, other)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(normal, a)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    corners = 0.5 * side_m * np.stack([-a - b, a - b, a + b, b - a], axis=1)
    vertices = rng.uniform(low, high, (n, 3))[:, None] + corners
    faces = 4 * np.arange(n)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    foliage = Mesh(
        vertices.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n), 2).astype(np.int32),
    )
    area_density = n * side_m**2 / np.prod(high - low)
    shots = scan(
        {"leaf": foliage},
        HERE,
        seed=1,
        angular_step_deg=0.1,
        window_m=(np.array([-1.1, 5.0, -1.1]), np.array([1.1, 5.01, 1.1])),
        **STILL,
        **THIN,
    )
    path_m = 1.0 / shots.direction[:, 1]
    gap = np.exp(-0.5 * area_density * path_m)  # spherical leaf angles: G = 0.5
    assert 0.2 < gap.mean() < 0.4
    # shots share leaves, so that the leaves within the view, not the shots, set the error
    seen = 2.2**2 / (0.5 * side_m**2)
    error = np.sqrt(gap.mean() * (1 - gap.mean()) / seen)
    assert (shots.n_returns == 0).mean() == pytest.approx(gap.mean(), abs=4 * error)


def test_noise_points_come_at_their_rate_along_the_whole_beam():
    options = {**STILL, "noise_points_per_shot": 0.05}
    shots = scan(
        {"wood": plate_to_the_north(5.0)},
        HERE,
        seed=1,
        angular_step_deg=0.1,
        window_m=around(4.0, 6.0, 1.0),
        **options,
    )
    noise = shots.truth == 7
    expected, n = 0.05, len(shots)
    assert noise.sum() / n == pytest.approx(expected, abs=4 * np.sqrt(expected / n))
    _, leave_m = through_box(np.zeros(3), shots.direction, *around(4.0, 6.0, 1.0))
    along = (shots.range_m[noise] - 0.5) / (leave_m[shots.shot_of_return[noise]] - 0.5)
    assert kstest(along, "uniform").pvalue > 1e-3
    for start, stop in zip(shots.first[:-1], shots.first[1:], strict=True):
        assert np.all(np.diff(shots.range_m[start:stop]) >= 0)


def test_only_the_nearest_returns_are_kept():
    plates = [plate_to_the_north(y, -0.001 * k, 1.0) for k, y in enumerate((5.0, 7.0, 9.0))]
    window = {"window_m": (np.array([-0.01, 5, -0.1]), np.array([0.01, 5.01, 0.1]))}
    common = {**STILL, **window, "angular_step_deg": 0.01, "sub_rays": 32}
    shapes = {"wood": concatenate(plates)}
    many = scan(shapes, HERE, seed=1, **common)
    few = scan(shapes, HERE, seed=1, max_returns=1, **common)
    assert many.n_returns.max() > 1
    assert few.n_returns.max() == 1
    some = many.n_returns > 0
    np.testing.assert_array_equal(few.range_m, many.range_m[many.first[:-1][some]])


def test_the_same_seed_gives_the_same_bytes_on_one_thread_or_two():
    def bytes_of(seed):
        shots = scan(
            {"leaf": plate_to_the_north(5.0)}, HERE, seed=seed, angular_step_deg=0.06, sub_rays=3
        )
        columns = (shots.range_m, shots.reflectance_db, shots.deviation, shots.truth, shots.first)
        return b"".join(column.tobytes() for column in columns)

    first = bytes_of(5)
    threads = drjit.thread_count()
    drjit.set_thread_count(1)
    try:
        assert bytes_of(5) == first
    finally:
        drjit.set_thread_count(threads)
    assert bytes_of(6) != first


def test_neighbouring_shots_are_one_angular_step_apart():
    low, high = around(4.9, 5.1, 1.0)
    view = {"zenith_min_deg": 30.0, "zenith_max_deg": 130.0}
    direction = np.concatenate(
        list(grid_directions(np.zeros(3), low, high, angular_step_deg=0.25, **view))
    )
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, atol=1e-7)
    np.testing.assert_array_equal(direction, direction.astype(np.float32))
    zenith = np.degrees(np.arccos(direction[:, 2]))
    azimuth = np.degrees(np.arctan2(direction[:, 0], direction[:, 1]))
    for angle in (zenith, azimuth):
        steps = np.diff(np.unique(angle.round(4)))
        np.testing.assert_allclose(steps, 0.25, atol=2e-4)


@pytest.mark.parametrize(
    "position", [[-9.0, 2.0, 0.5], [0.5, 0.5, 0.5], [0.3, 0.2, -4.0], [9.0, -7.0, 3.0]]
)
def test_the_window_keeps_every_direction_that_can_meet_it(position):
    low, high = np.array([-1.0, -0.5, -0.2]), np.array([1.2, 2.0, 2.5])
    view = {"angular_step_deg": 3.0, "zenith_min_deg": 0.0, "zenith_max_deg": 180.0}
    kept = np.concatenate(list(grid_directions(np.array(position), low, high, **view)))
    azimuth, zenith = np.radians(np.meshgrid(np.arange(0.0, 360, 3), np.arange(0.0, 181, 3)))
    every = np.stack(
        [np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)], -1
    ).reshape(-1, 3)
    # march along each direction in small steps: an independent test of meeting the box
    places = np.array(position) + every[:, None] * np.arange(0.0, 16.0, 0.02)[:, None]
    meets = ((places > low) & (places < high)).all(axis=2).any(axis=1)
    assert meets.any()
    distance, _ = cKDTree(kept).query(every)
    assert distance[meets].max() < 1e-6
    assert (distance < 1e-6).sum() < 1.1 * meets.sum() + 10


def test_a_window_without_margin_loses_no_hit():
    leaf = rectangle([0.3, 9.0, 0.8], [0.03, 0.01, 0], [0, 0.01, 0.03])
    common = {**STILL, "angular_step_deg": 0.02, "sub_rays": 19}
    close = scan({"leaf": leaf}, HERE, seed=1, **common)
    wide = scan({"leaf": leaf}, HERE, seed=1, window_m=around(8.5, 9.5, 1.2), **common)

    fired = {tuple(direction) for direction in close.direction}
    met = {tuple(direction) for direction in wide.direction[wide.n_returns > 0]}
    assert len(wide) > 100 * len(close)
    assert len(met) > 100
    assert met <= fired


def test_sub_rays_carry_a_gaussian_beams_energy():
    radius = np.linalg.norm(beam_pattern(1000), axis=1)
    for r in (0.25, 0.5, 1.0):
        assert (radius < r).mean() == pytest.approx(1 - np.exp(-2 * r**2), abs=1e-3)
    assert np.abs(beam_pattern(1000).mean(axis=0)).max() < 0.01


def test_positions_go_round_clockwise_from_north():
    positions = positions_around(np.array([1.0, 2.0, 0.5]), radius_m=10.0, n=4, height_m=1.6)
    expected = [[1, 12, 2.1], [11, 2, 2.1], [1, -8, 2.1], [-9, 2, 2.1]]
    np.testing.assert_allclose(positions, expected, atol=1e-12)


def test_each_position_has_its_own_scan_number_and_origin():
    positions = positions_around(np.zeros(3), radius_m=6.0, n=3, height_m=0.0)
    plant = {"wood": rectangle([0, 0, 0], [0.2, 0, 0], [0, 0, 0.2])}
    shots = scan(plant, positions, seed=1, angular_step_deg=1.0, **STILL)
    assert set(shots.scan) == {1, 2, 3}
    np.testing.assert_array_equal(shots.origin_m, positions[shots.scan - 1])


def test_a_plant_out_of_the_field_of_view_is_an_error_that_says_so():
    overhead = rectangle([0, 0, 9.0], [0.5, 0, 0], [0, 0.5, 0])
    with pytest.raises(InputError, match="no shot that meets the window"):
        scan({"leaf": overhead}, HERE, seed=1, angular_step_deg=1.0, **STILL)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"sub_rays": 0}, "scan.sub_rays"), ({"angular_step_deg": 0.0}, "scan.angular_step_deg")],
)
def test_a_setting_out_of_range_is_named(change, message):
    with pytest.raises(InputError, match=message):
        scan({"wood": plate_to_the_north(5.0)}, HERE, seed=1, **change)


def test_an_unknown_surface_or_an_empty_plant_is_an_error():
    with pytest.raises(InputError, match="fruit"):
        scan({"wood": plate_to_the_north(5.0), "fruit": plate_to_the_north(6.0)}, HERE, seed=1)
    with pytest.raises(InputError, match="no or infinite vertices"):
        scan({}, HERE, seed=1)
