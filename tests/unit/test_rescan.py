"""Shots predicted from reconstructions: walls that end them, gaps that let them through."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple import steps
from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.virtual import left_out, rescan, rescan_scores

BEAM = {"exit_aperture_m": 0.007, "beam_divergence_mrad": 0.35, "sub_rays": 7}
HOW = {"layers": 2, "tolerance_m": 0.05, "max_deviation": 15.0, "seed": 1} | BEAM


def wall(y_m, low=(-1.0, 0.0), high=(1.0, 2.0)):
    """An upright rectangle across the north."""
    (x0, z0), (x1, z1) = low, high
    corners = np.array([[x0, y_m, z0], [x1, y_m, z0], [x1, y_m, z1], [x0, y_m, z1]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def shots_north(range_of, n=40, reach_m=0.95, deviation=0.0, scan=1):
    """Level shots to the north, in a square grid; `range_of` (x, z) gives a range or infinity."""
    x, z = (g.ravel() for g in np.meshgrid(*[np.linspace(-reach_m, reach_m, n)] * 2))
    z = z + 1.0
    range_m = range_of(x, z) * np.ones(len(x))
    ends = np.isfinite(range_m)
    m = int(ends.sum())
    bright_db = np.full(m, -8.0, np.float32)
    bright_db[: m // 100 + 1] = -20.0  # the scanner sees as weak returns as these
    return Shots(
        np.stack([x, np.full(len(x), -5.0), z], axis=1),
        np.tile([0.0, 1.0, 0.0], (len(x), 1)),
        np.full(len(x), scan, np.uint16),
        np.concatenate([[0], np.cumsum(ends)]),
        range_m[ends],
        bright_db,
        np.full(m, deviation, np.float32),
        np.zeros(3),
    )


def box_cloud():
    """Leaf points at the corners of a box from 1 m south to 1 m north of the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 2)], float)
    kinds = np.full(len(corners), 4, np.uint8)
    dark = np.full(len(corners), -8.0)
    return Cloud(corners, attributes={"Classification": kinds, "Reflectance": dark})


def all_of(table):
    return table[(table["layer"] == "all") & (table["zone"] == "all")].iloc[0]


def test_a_wall_where_shots_ended_predicts_all_of_them():
    found = steps.rescan(
        {"leaf": wall(0.0)}, None, [shots_north(lambda x, z: 5.0)], box_cloud(), **HOW
    )
    row = all_of(found)
    assert row["right_share"] == 1.0
    assert row["passed_share"] == row["predicted_passed_share"] == 0.0
    assert row["range_bias_m"] == pytest.approx(0.0, abs=1e-4)


def test_a_wall_too_far_back_has_the_bias_of_its_distance_and_no_shot_right():
    found = steps.rescan(
        {"leaf": wall(0.2)}, None, [shots_north(lambda x, z: 5.0)], box_cloud(), **HOW
    )
    row = all_of(found)
    assert row["range_bias_m"] == pytest.approx(0.2, abs=1e-4)
    assert (row["right_share"], row["hit_or_pass_share"]) == (0.0, 1.0)


def test_a_mixed_return_tells_that_a_shot_ended_and_not_where():
    mixed = shots_north(lambda x, z: 5.0, deviation=30.0)
    row = all_of(steps.rescan({"leaf": wall(0.2)}, None, [mixed], box_cloud(), **HOW))
    assert row["right_share"] == 1.0
    assert np.isnan(row["range_bias_m"])


def test_the_share_that_passes_is_told_by_height_and_by_distance_from_the_axis():
    upper = lambda x, z: np.where(z > 1, np.inf, 5.0)  # noqa: E731
    lower_wall = wall(0.0, high=(1.0, 1.0))
    found = steps.rescan({"leaf": lower_wall}, None, [shots_north(upper)], box_cloud(), **HOW)
    layers = found[found["zone"] == "all"].set_index("layer")
    assert layers.loc["1", "passed_share"] == pytest.approx(0.0, abs=0.06)
    assert layers.loc["2", "passed_share"] == pytest.approx(1.0, abs=0.06)
    assert layers.loc["all", "right_share"] == pytest.approx(1.0, abs=0.03)
    assert set(found["zone"]) == {"all", *rescan_scores.ZONES}


def test_a_beam_is_ended_by_an_edge_that_its_axis_passes():
    edge_m = 0.002
    beside = shots_north(lambda x, z: np.inf, n=1, reach_m=0.0)
    blade = {"leaf": wall(0.0, low=(edge_m, 0.0))}
    for aperture_m, expected in ((0.02, 0.0), (0.0, 1.0)):
        how = HOW | {"exit_aperture_m": aperture_m, "beam_divergence_mrad": 0.0}
        row = all_of(steps.rescan(blade, None, [beside], box_cloud(), **how))
        assert row["predicted_passed_share"] == expected


def test_turbid_voxels_let_through_what_beer_and_lambert_say():
    size_m, density = 0.5, 1.2
    axes = {"x": 4, "y": 4, "z": 4}
    voxels = xr.Dataset(
        {"plant_area_density_m2_m3": (list(axes), np.full((4, 4, 4), density))},
        {
            "x": -0.75 + size_m * np.arange(4),
            "y": -0.75 + size_m * np.arange(4),
            "z": 0.25 + size_m * np.arange(4),
        },
        {"voxel_size_m": size_m, "leaf_angle_distribution": "spherical"},
    )
    shots = shots_north(lambda x, z: np.inf, n=150)
    row = all_of(steps.rescan({}, voxels, [shots], box_cloud(), **HOW))
    expected = np.exp(-0.5 * density * 2.0)
    error = np.sqrt(expected * (1 - expected) / row["shots"])
    assert abs(row["predicted_passed_share"] - expected) < 4 * error


def test_what_lies_before_or_behind_the_crown_counts_neither_as_hit_nor_as_seen():
    before = shots_north(lambda x, z: np.where(x < 0, 2.0, 9.0))
    row = all_of(steps.rescan({"leaf": wall(0.0)}, None, [before], box_cloud(), **HOW))
    assert row["shots"] == len(before) / 2
    assert row["passed_share"] == 1.0


def test_chance_alone_is_no_error_of_gaps_where_patches_agree():
    rows = pd.DataFrame(
        {
            "scan": 1,
            "seen_m": np.tile([5.0, np.inf], 500),
            "predicted_m": np.tile([np.inf, 5.0], 500),
            "is_mixed": False,
            "azimuth_deg": 10.5,
            "zenith_deg": 90.5,
        }
    )
    found = rescan_scores.scored(rows, 0.05)
    assert (found["gap_rmse"], found["hit_or_pass_share"]) == (0.0, 0.0)


def test_points_of_the_other_positions_have_the_classes_of_all():
    mine, other = (shots_north(lambda x, z: 5.0, scan=k) for k in (1, 2))
    points = mine.return_xyz_m
    kinds = np.where(points[:, 2] > 1.0, 4, 0).astype(np.uint8)
    classified = Cloud(points, attributes={"Classification": kinds})
    how = {"majority_voxel_m": 0.01, "max_deviation": 15.0, "thin_voxel_m": 0.001}
    seen = left_out.seen_from([other], classified, **how)
    assert len(seen) == len(points)
    is_leaf = seen.attributes["Classification"] == 4
    np.testing.assert_array_equal(is_leaf, seen.xyz_m[:, 2] > 1.0)


def test_a_scanner_detects_what_the_scan_shows():
    scan = [shots_north(lambda x, z: 5.0)]
    scanner = rescan.scanner_of(box_cloud(), scan, **BEAM)
    assert scanner.min_energy == pytest.approx(0.01)
    assert scanner.leaf_reflectance_db == (-8.0, 0.0)
    bare = Cloud(box_cloud().xyz_m, attributes={"Classification": np.full(8, 4, np.uint8)})
    assert rescan.scanner_of(bare, scan, **BEAM).leaf_reflectance_db == (0.0, 0.0)
