"""Signals: each says what it should of small scans whose trouble is known."""

import math

import numpy as np
import pytest
import xarray as xr

from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh, empty
from dapple.formats.shots import Shots
from dapple.structure import summary
from dapple.structure.polygons import reconstruct
from dapple.structure.voxel_data import CAPPED
from dapple.verdict import (
    signals,
    signals_light,
    signals_scan,
    signals_structure,
)
from dapple.verdict.run_data import RunData, points_per_polygon
from dapple.verdict.signal_meanings import ABSENT, OF_RECORDS, SIGNALS

DIMS = ("x", "y", "z")


def rng():
    return np.random.default_rng(1)


def voxels(density, n_shots=1000, size=0.2):
    """Voxels from a corner at 0, with a path of 2/3 of the edge a shot."""
    density = np.asarray(density, float)
    n_shots = np.broadcast_to(n_shots, density.shape)
    data = {
        "plant_area_density_m2_m3": density,
        "n_shots": n_shots,
        "entering": n_shots.astype(float),
        "intercepted": np.zeros(density.shape),
        "path_length_m": 2 / 3 * size * n_shots,
        "flag": np.where(density >= 5, CAPPED, 0).astype(np.uint8),
    }
    coords = {a: (np.arange(n) + 0.5) * size for a, n in zip(DIMS, density.shape, strict=True)}
    return xr.Dataset({k: (DIMS, v) for k, v in data.items()}, coords, {"voxel_size_m": size})


def shots_from(origins, towards, range_m):
    """One shot from each origin to each target, each with one return."""
    n = len(towards)
    way = np.concatenate([towards - origin for origin in origins])
    length = np.linalg.norm(way, axis=1)
    many = len(origins) * n
    return Shots(
        np.repeat(origins, n, axis=0),
        way / length[:, None],
        np.repeat(np.arange(len(origins)), n).astype(np.uint16),
        np.arange(many + 1),
        length if range_m is None else np.full(many, range_m),
        np.zeros(many, np.float32),
        np.zeros(many, np.float32),
        np.zeros(3),
    )


def around(*azimuths_deg, radius=10.0):
    angle = np.radians(azimuths_deg)
    return np.stack([radius * np.sin(angle), radius * np.cos(angle), np.ones(len(angle))], axis=1)


def light(par, direct=None, minutes=20):
    """A light dataset of sensors (s) and times (t)."""
    par = np.asarray(par, float)
    when = np.datetime64("2023-08-10T10:00", "ns") + np.arange(par.shape[1]) * np.timedelta64(
        minutes, "m"
    )
    names = {"par_umol_m2_s": par, "par_direct_umol_m2_s": par if direct is None else direct}
    coords = {"sensor": [str(k) for k in range(len(par))], "time": when}
    return xr.Dataset({k: (("sensor", "time"), v) for k, v in names.items()}, coords)


# What beams reached


@pytest.mark.parametrize(
    ("azimuths", "gap"), [((0,), 360), ((0, 180), 180), ((0, 90, 180, 270), 90), ((350, 10), 340)]
)
def test_the_largest_gap_is_the_arc_without_a_scan(azimuths, gap):
    cloud = Cloud(rng().normal(0, 1, (500, 3)))
    shots = shots_from(around(*azimuths, radius=1000.0), np.zeros((5, 3)), None)
    assert signals_scan.scan_count(shots, cloud) == len(azimuths)
    assert signals_scan.largest_gap_deg(shots, cloud) == pytest.approx(gap, abs=1)


def test_a_hole_in_the_crown_is_unknown_and_empty_sky_is_not():
    density = np.zeros((12, 12, 12))
    density[2:10, 2:10, 2:10] = 1.0
    density[4:8, 4:8, 4:8] = np.nan
    density[0, 0] = np.nan  # far from any leaf
    grid = voxels(density)
    assert signals_scan.unknown_share(grid) == pytest.approx(64 / 512)


def test_the_sun_s_way_counts_only_the_crown_it_crosses():
    density = np.ones((10, 10, 10))
    density[:, :, 5:] = np.nan  # the upper half, within the hull of two leafy layers above it
    density[:, :, 8:] = 1.0
    grid = voxels(density, n_shots=np.where(np.isnan(density), 0, 10**6))
    sensor, up = np.array([[1.0, 1.0, -1.0]]), np.zeros(1)
    unknown, seen = signals_scan.on_sun_beams(grid, sensor, up, up, rng())
    assert unknown == pytest.approx(0.3, abs=0.02)
    assert seen == pytest.approx(0.7, abs=0.02)
    # Beside the crown the sun crosses nothing, and nothing can be said.
    aside = signals_scan.on_sun_beams(grid, sensor + np.array([9, 0, 0]), up, up, rng())
    assert all(math.isnan(value) for value in aside)


def test_returns_that_the_filter_took_away_are_noise():
    xyz = rng().uniform(0, 0.2, (5000, 3)) + np.array([10, 0, 0])
    cloud = Cloud(np.concatenate([xyz, [[9.0, -1, -1], [11.0, 1, 1]]]))
    stray = rng().uniform([9.05, -0.9, -0.9], [10.9, 0.9, 0.9], (1000, 3))
    stray = stray[np.abs(stray - [10.1, 0.1, 0.1]).max(axis=1) > 0.3]
    both = np.concatenate([xyz, stray])
    shots = shots_from(np.zeros((1, 3)), both, None)
    expected = len(stray) / len(both)
    assert signals_scan.noise_share(shots, cloud, rng()) == pytest.approx(expected, abs=0.01)


def test_a_noise_point_far_away_does_not_widen_the_crown():
    density = np.full((30, 30, 30), np.nan)
    density[:6, :6, :6] = 1.0
    alone = voxels(density)
    density[-1, -1, -1] = 1.0
    assert signals_scan.unknown_share(voxels(density)) == signals_scan.unknown_share(alone) == 0
    assert signals_structure.voxels_per_crown(voxels(density)) == pytest.approx(1 / 6)


# How scans fit together


def two_scans(shift_m, n=4000):
    """The same surface seen twice, the second time moved."""
    xyz = rng().uniform(-1, 1, (2 * n, 3))
    xyz[:, 2] = 0.3 * np.sin(3 * xyz[:, 0]) * np.cos(3 * xyz[:, 1])
    xyz[n:] += np.asarray(shift_m)
    return Cloud(xyz, attributes={"PointSourceId": np.repeat([1, 2], n)})


def test_a_scan_that_is_out_of_place_is_found_by_how_far_it_has_to_slide():
    right, wrong = (signals_scan.scan_fit(two_scans(s), rng()) for s in ((0, 0, 0), (0, 0, 0.05)))
    assert right[0] < 0.01
    assert wrong[0] == pytest.approx(0.05, abs=0.01)
    assert wrong[1] == pytest.approx(right[1], abs=0.005)  # rigid: it fits after the slide


def test_leaves_that_moved_between_scans_do_not_fit_after_any_slide():
    still = two_scans((0, 0, 0))
    blown = Cloud(still.xyz_m + rng().normal(0, 0.05, (8000, 3)), attributes=still.attributes)
    assert signals_scan.scan_fit(blown, rng())[1] > 1.5 * signals_scan.scan_fit(still, rng())[1]


# Reflectance


def reflectance(leaf_db, wood_db, threshold_db, n=20_000, wood=0.2):
    """Points of two kinds, told apart by a threshold."""
    values = np.concatenate(
        [
            rng().normal(leaf_db, 1.5, round(n * (1 - wood))),
            rng().normal(wood_db, 1.1, round(n * wood)),
        ]
    )
    kinds = np.where(values <= threshold_db, 4, 0).astype(np.uint8)
    return Cloud(
        np.zeros((len(values), 3)), attributes={"Reflectance": values, "Classification": kinds}
    )


def test_two_clear_kinds_have_a_separation_a_valley_and_a_gain():
    clear = signals_scan.reflectance_classes(reflectance(-8, -2, -5.4), rng())
    mixed = signals_scan.reflectance_classes(reflectance(-8, -8, -5.4), rng())
    assert clear["reflectance_separation"] == pytest.approx(
        math.sqrt(2) * 6 / math.hypot(1.5, 1.1), rel=0.1
    )
    assert clear["reflectance_valley"] > 0.4 > 0.2 > mixed["reflectance_valley"]
    assert clear["reflectance_gain"] > 0.1 > 0.02 > mixed["reflectance_gain"]


def test_a_drift_of_calibration_moves_the_threshold_through_the_leaves():
    heights = [
        signals_scan.reflectance_classes(reflectance(-8 + d, -2 + d, -5.4, wood=0.02), rng())[
            "threshold_height"
        ]
        for d in (-2, 0, 2)
    ]
    assert heights[1] == pytest.approx(2.6 / 1.5, rel=0.25)
    assert heights[0] > heights[1] + 0.5 > heights[2] + 1


def test_without_reflectance_nothing_is_known_of_it():
    cloud = Cloud(np.zeros((500, 3)), attributes={"Classification": np.full(500, 4)})
    assert all(math.isnan(v) for v in signals_scan.reflectance_classes(cloud, rng()).values())


# Polygons and voxels


def test_points_of_polygons_are_counted_in_the_order_of_their_elements():
    xyz = rng().uniform(0, 0.3, (400, 3))
    polygons = reconstruct(xyz, seed=1)
    cloud = Cloud(xyz, attributes={"Classification": np.full(400, 4)})
    number = points_per_polygon(cloud, polygons, 0.05)
    assert len(number) == polygons.n_elements
    assert number.sum() == 400
    lonely = np.floor(xyz / 0.05).astype(int)
    first = np.unique(lonely, axis=0)[0]
    assert number[0] == (lonely == first).all(axis=1).sum()
    assert signals_structure.sparse_share(np.array([1, 2, 3, 9])) == 0.5


def test_polygons_of_other_points_have_no_count():
    xyz = rng().uniform(0, 0.3, (400, 3))
    cloud = Cloud(xyz, attributes={"Classification": np.full(400, 4)})
    assert points_per_polygon(cloud, reconstruct(xyz[:20], seed=1), 0.05) is None
    wood = Cloud(xyz, attributes={"Classification": np.zeros(400)})
    assert points_per_polygon(wood, empty(), 0.05) is None


def flat_leaves(n=200):
    """Level squares of 0.1 m in a plane, apart from each other."""
    corner = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]])
    at = np.stack([np.arange(n) * 0.2, np.zeros(n), np.zeros(n)], axis=1)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(n)[:, None, None]
    vertices = (at[:, None] + corner).reshape(-1, 3)
    return Mesh(vertices, faces.reshape(-1, 3).astype(np.int32), np.repeat(np.arange(n), 2))


def test_points_off_a_polygon_s_plane_are_told_in_its_size():
    leaves = flat_leaves()
    xyz = leaves.vertices_m + np.array([0, 0, 0.02])
    cloud = Cloud(xyz, attributes={"Classification": np.full(len(xyz), 4)})
    assert signals_structure.distance_to_polygons(cloud, leaves, rng()) == pytest.approx(0.2)


def test_level_leaves_depart_from_spherical_angles_by_a_half():
    leaves = flat_leaves()
    assert signals_structure.tilt_departure(leaves, np.full(200, 9)) == pytest.approx(0.5)
    assert math.isnan(signals_structure.tilt_departure(leaves, np.full(200, 2)))


def test_the_share_at_the_cap_is_of_leaf_area():
    density = np.ones((5, 5, 5))
    density[0] = 5.0
    grid = voxels(density)
    assert signals_structure.capped_share(grid) == pytest.approx(125 / 225)
    assert signals_structure.plant_area_index(grid) == pytest.approx((1.0 * 20 + 5.0 * 5) / 25)
    assert summary.voxel_area_m2(grid) == pytest.approx(225 * 0.008)


# Light


def test_light_that_changes_when_sensors_move_is_sensitive():
    par = rng().uniform(0, 1000, (20, 10))
    same, other = light(par), light(np.roll(par, 3, axis=0))
    assert signals_light.shift_sensitivity(same, same) == 0
    assert signals_light.shift_sensitivity(same, other) == pytest.approx(math.sqrt(2), rel=0.1)


def test_agreement_is_correlation_and_difference_of_means():
    par = rng().uniform(500, 1000, (20, 10))
    assert signals_light.agreement(light(par), light(0.5 * par)) == pytest.approx((1.0, 0.5))
    assert math.isnan(signals_light.agreement(light(par), None)[0])


def moving_shade(lag_min, minutes=2, n=120):
    """A shadow's edge that crosses sensors through four hours."""
    when = np.arange(n) * minutes + lag_min
    return 1000 / (1 + np.exp(-(when[None] - np.linspace(60, 180, 12)[:, None]) / 4))


@pytest.mark.parametrize("lag", [0, 4, -7, 12])
def test_a_clock_that_is_wrong_is_found_from_records(lag):
    records = light(moving_shade(0), minutes=2)["par_umol_m2_s"]
    found = signals_light.best_lag_min(light(moving_shade(lag), minutes=2), records)
    assert found == pytest.approx(abs(lag), abs=1)


def test_sensors_out_of_place_fit_better_elsewhere_half_of_the_time():
    def course(x):
        return 500 + 400 * np.sin(3 * x[:, None] + np.linspace(0, 4, 15))

    true = rng().uniform(0, 100, 300)
    records = light(course(true))["par_umol_m2_s"]
    step = 0.1 * rng().choice([-1, 1], 300)
    right = signals_light.misplaced_share(light(course(true)), light(course(true + step)), records)
    moved = true + 0.3 * np.random.default_rng(2).choice([-1, 1], 300)
    wrong = signals_light.misplaced_share(
        light(course(moved)), light(course(moved + step)), records
    )
    assert right == 0
    assert wrong == pytest.approx(0.5, abs=0.1)


# All together


def a_run(**more):
    xyz = rng().uniform(0, 2, (3000, 3))
    kinds = np.where(np.arange(3000) % 10, 4, 0)
    cloud = Cloud(xyz, attributes={"Classification": kinds})
    return RunData(**({"shots": None, "cloud": cloud, "leaves": empty(), "wood": empty()} | more))


def test_every_signal_is_always_there_and_unknown_where_it_must_be():
    bare = signals.measure(a_run())
    assert set(bare) == set(SIGNALS)
    assert {name for name, value in bare.items() if math.isfinite(value)} == {"wood_share"}
    named = [name for names, *_ in ABSENT.values() for name in names]
    assert set(named) | set(OF_RECORDS) <= set(SIGNALS)


def test_the_same_run_gives_the_same_signals():
    cloud = a_run().cloud
    leaves = reconstruct(cloud.xyz_m[cloud.attributes["Classification"] == 4], seed=1)
    par = rng().uniform(0, 1000, (6, 12))
    full = a_run(
        leaves=leaves,
        points_per_polygon=points_per_polygon(cloud, leaves, 0.05),
        shots=shots_from(around(0, 120, 240), cloud.xyz_m[:500], None),
        voxels={
            "voxels_1.0": voxels(np.ones((2, 2, 2)), size=1.0),
            "voxels_0.2": voxels(np.ones((10, 10, 10))),
        },
        light={
            "polygons": light(par),
            "voxels_0.2": light(0.9 * par),
            "voxels_1.0": light(par[::-1]),
        },
        moved_light={"polygons": light(1.1 * par)},
        sensors_m=rng().uniform(0, 2, (6, 3)) * [1, 1, 0],
        sun_zenith_deg=np.linspace(30, 60, 12),
        sun_azimuth_deg=np.linspace(150, 250, 12),
    )
    first, again = signals.measure(full), signals.measure(full)
    assert first == pytest.approx(again, nan_ok=True, abs=0)
    assert first["r_polygons_fine"] == pytest.approx(1)
    assert first["area_fine_to_coarse"] == pytest.approx(0)
    assert first["largest_gap_deg"] == pytest.approx(120, abs=15)
    unknown = {name for name, value in first.items() if not math.isfinite(value)}
    assert unknown == {
        "scan_shift_m", "scan_residual_m", "reflectance_separation", "reflectance_gain",
        "reflectance_valley", "threshold_height", "class_contrast", "tilt_departure",
        "sensitivity_fine", "sensitivity_coarse", *OF_RECORDS,
        *(name for name, signal in SIGNALS.items() if signal.only_of == "surfels"),
        # So few shots fill no patch.
        "gap_error_polygons", "gap_error_fine", "gap_error_coarse",
    }  # fmt: skip


def test_scans_of_points_without_shots_are_those_that_the_points_name():
    xyz = rng().uniform(size=(60, 3))
    named = Cloud(xyz, attributes={"PointSourceId": np.arange(60) % 3 + 1})
    assert signals_scan.scan_count(None, named) == 3
    assert math.isnan(signals_scan.scan_count(None, Cloud(xyz)))
    unnamed = Cloud(xyz, attributes={"PointSourceId": np.zeros(60, int)})
    assert math.isnan(signals_scan.scan_count(None, unnamed))


def test_without_a_crown_or_a_sun_nothing_is_on_the_way_of_its_beams():
    full, bare = voxels(np.full((3, 3, 3), 1.0)), voxels(np.zeros((3, 3, 3)))
    sensor = np.array([[0.3, 0.3, 0.0]])
    for grid, zenith_deg in ((full, 95.0), (bare, 20.0)):
        found = signals_scan.on_sun_beams(
            grid, sensor, np.array([zenith_deg]), np.array([180.0]), rng()
        )
        assert np.isnan(found).all()
    assert math.isnan(signals_scan.seen_share(bare))


def test_a_scan_without_neighbours_fits_none():
    xyz = rng().uniform(size=(200, 3))
    lone = Cloud(xyz, attributes={"PointSourceId": np.repeat([1, 2], [190, 10])})
    assert np.isnan(signals_scan.scan_fit(lone, rng())).all()
