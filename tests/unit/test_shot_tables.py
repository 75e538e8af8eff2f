"""Shots that other programs write one by one keep their misses, their starts and their returns."""

import numpy as np
import pytest

from dapple.cloud import shot_sources
from dapple.errors import InputError
from dapple.formats import clouds, shot_tables
from dapple.formats import shots as shot_files
from dapple.formats.cloud_raw import MISSED

START = np.array([[0.0, 0.0, 1.5], [4.0, 0.0, 1.6]])
N = 60


def fired(n=N):
    """Start, direction and up to two ranges of each shot; every fourth meets nothing."""
    rng = np.random.default_rng(6)
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    range_m = np.sort(rng.uniform(2, 9, (n, 2)), axis=1)
    range_m[::4] = np.nan
    range_m[1::4, 1] = np.nan
    return START[np.arange(n) * 2 // n], direction, range_m


def ends(start, direction, range_m):
    """The places of all returns, shot by shot."""
    shot, which = np.nonzero(np.isfinite(range_m))
    return start[shot] + direction[shot] * range_m[shot, which][:, None]


def amapvox(path, start, direction, range_m, swapped=False):
    names = ["XOrigin", "YOrigin", "ZOrigin", "XDirection", "YDirection", "ZDirection"]
    names += ["Range0", "Range1", "EmptyShot"]
    empty = np.isnan(range_m[:, 0]).astype(int)
    ranges = range_m[:, ::-1] if swapped else range_m
    rows = np.column_stack([start, 3 * direction, ranges, empty])
    text = "\n".join(" ".join("NaN" if v != v else f"{v:.9g}" for v in row) for row in rows)
    path.write_text(" ".join(f'"{name}"' for name in names) + "\n" + text + "\n")
    return path


def helios(folder, start, direction, range_m):
    """Points of a simulation, and the pulses beside them in another order."""
    shot, _ = np.nonzero(np.isfinite(range_m))
    xyz = ends(start, direction, range_m)
    points = np.column_stack([xyz, np.full((len(shot), 4), 7.0), shot + 100, np.zeros(len(shot))])
    pulses = np.column_stack([start, direction, np.zeros(len(start)), np.arange(len(start)) + 100])
    np.savetxt(folder / "leg000_points.xyz", points[::-1], fmt="%.6f")
    np.savetxt(folder / "leg000_pulse.txt", pulses[::-1], fmt="%.6f")
    return folder / "leg000_points.xyz"


@pytest.mark.parametrize("swapped", [False, True], ids=["near first", "far first"])
def test_shots_of_amapvox_are_read_with_their_misses(tmp_path, swapped):
    start, direction, range_m = fired()
    path = amapvox(tmp_path / "shots.txt", start, direction, range_m, swapped)
    found = clouds.fired(path)
    assert np.array_equal(np.diff(found.first), np.isfinite(range_m).sum(axis=1))
    assert found.direction == pytest.approx(direction, abs=1e-7)
    assert found.return_xyz_m == pytest.approx(ends(start, direction, range_m), abs=1e-6)


def test_a_shot_that_is_called_empty_is_empty_whatever_its_range(tmp_path):
    path = tmp_path / "shots.txt"
    head = "XDirection YDirection ZDirection Range0 EmptyShot"
    path.write_text(f"{head}\n0 0 1 3 0\n0 1 0 999 1\n1 0 0 0 0\n")
    found = clouds.fired(path)
    assert np.diff(found.first).tolist() == [1, 0, 0]
    assert not found.origin_m.any()


def test_the_points_of_a_table_of_shots_are_its_returns(tmp_path):
    start, direction, range_m = fired()
    path = amapvox(tmp_path / "shots.txt", start, direction, range_m)
    cloud, source = clouds.read_with_source(path)
    assert cloud.xyz_m + cloud.origin_m == pytest.approx(ends(start, direction, range_m), abs=1e-6)
    assert source.left_out == {MISSED: N // 4}
    assert cloud.attributes["NumberOfReturns"].max() == 2


def test_pulses_of_helios_without_a_point_met_nothing(tmp_path):
    start, direction, range_m = fired()
    found = clouds.fired(helios(tmp_path, start, direction, range_m))
    assert np.array_equal(np.diff(found.first)[::-1], np.isfinite(range_m).sum(axis=1))
    order = [np.lexsort(np.round(x, 4).T) for x in (found.return_xyz_m, ends(*fired()))]
    assert found.return_xyz_m[order[0]] == pytest.approx(ends(*fired())[order[1]], abs=1e-4)


@pytest.mark.parametrize(
    ("points", "pulses", "message"),
    [
        ("1 2 3 4\n", "0 0 0 0 0 1 0 5\n", "4 columns"),
        ("1 2 3 4 1 1 1 6\n", "0 0 0 0 0 1 0 5\n", "points of pulses that are not there"),
        ("1 2 3 4 1 1 1 5\n", "0 0 0 0 0 0 0 5\n", r"a direction \[0.0, 0.0, 0.0\] in row 1"),
        ("1 2 3 4 1 1 1 5\n", "0 0 0 0 x 1 0 5\n", "text in column 4"),
    ],
)
def test_files_of_helios_that_do_not_belong_together_say_so(tmp_path, points, pulses, message):
    (tmp_path / "a_points.xyz").write_text(points)
    (tmp_path / "a_pulse.txt").write_text(pulses)
    with pytest.raises(InputError, match=message):
        shot_tables.read_helios(tmp_path / "a_points.xyz")


def test_a_table_of_points_is_no_table_of_shots(tmp_path):
    (tmp_path / "a.xyz").write_text("1 2 3\n4 5 6\n")
    assert clouds.fired(tmp_path / "a.xyz") is None


# --- into the shots of a run ----------------------------------------------------------------


def written(tmp_path, found):
    """What comes back of shots told one by one when they were written."""
    cloud_origin = np.array([1.0, 2.0, 0.0])
    pieces, moving = shot_sources.one_by_one(found, cloud_origin)
    path = tmp_path / "shots.parquet"
    shot_files.write_chunks(path, (shots for shots, _ in pieces), moving=moving)
    return shot_files.read(path), moving


def test_each_place_that_shots_start_from_is_a_scan(tmp_path):
    path = amapvox(tmp_path / "shots.txt", *fired())
    shots, moving = written(tmp_path, clouds.fired(path))
    assert not moving
    assert np.unique(shots.scan).tolist() == [1, 2]
    assert shots.origin_m + shots.world_origin_m == pytest.approx(fired()[0], abs=1e-6)
    assert (shots.n_returns == 0).sum() == N // 4


def test_shots_of_a_scanner_that_moves_keep_their_places(tmp_path):
    _, direction, range_m = fired(n=4 * shot_sources.MOST_PLACES)
    start = np.column_stack([np.linspace(0, 20, len(direction)), np.zeros((len(direction), 2))])
    path = amapvox(tmp_path / "shots.txt", start, direction, range_m)
    shots, moving = written(tmp_path, clouds.fired(path))
    assert moving
    assert set(shots.scan) == {1}
    assert shots.origin_m + shots.world_origin_m == pytest.approx(start, abs=1e-5)
    assert shots.return_xyz_m + shots.world_origin_m == pytest.approx(
        ends(start, direction, range_m), abs=1e-4
    )
