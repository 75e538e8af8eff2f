"""Shots survive being written, and a bad file says what is wrong with it."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from dapple.errors import InputError
from dapple.formats import shots as files
from dapple.formats.shots import Shots

PLACES = np.array([[10.0, 0.1, 1.6], [-1 / 3, 9.9, 1.7]])
FIELDS = (
    "origin_m",
    "direction",
    "scan",
    "first",
    "range_m",
    "reflectance_db",
    "deviation",
    "world_origin_m",
    "truth",
)


def some_shots(n=1000, truth=True, seed=1):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    n_returns = rng.integers(0, 4, n)
    m = n_returns.sum()
    scan = np.sort(rng.integers(1, 3, n)).astype(np.uint16)
    return Shots(
        PLACES[scan - 1],
        direction.astype(np.float32).astype(np.float64),
        scan,
        np.concatenate([[0], np.cumsum(n_returns)]),
        rng.uniform(1, 15, m).astype(np.float32).astype(np.float64),
        rng.normal(-8, 2, m).astype(np.float32),
        np.where(rng.random(m) < 0.1, np.nan, 3.0).astype(np.float32),
        np.array([410_500.25, 5_317_080.125, 288.7]),
        rng.choice([0, 2, 4, 7], m).astype(np.uint8) if truth else None,
    )


def assert_same(found, expected):
    for name in FIELDS:
        one, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_array_equal(one, other, err_msg=name)
        if other is not None:
            assert one.dtype == other.dtype, name


@pytest.mark.parametrize("truth", [True, False])
def test_a_file_gives_back_exactly_what_was_written(tmp_path, truth):
    shots = some_shots(truth=truth)
    files.write(tmp_path / "shots.parquet", shots)
    assert_same(files.read(tmp_path / "shots.parquet"), shots)


def test_chunks_written_one_by_one_are_the_whole(tmp_path):
    shots = some_shots()
    chunks = (files.part(shots, at, at + 130) for at in range(0, 1000, 130))
    assert files.write_chunks(tmp_path / "shots.parquet", chunks) == 1000
    assert_same(files.read(tmp_path / "shots.parquet"), shots)


@pytest.mark.parametrize("chunk_shots", [1, 77, 5000])
def test_reading_in_chunks_gives_every_shot_once(tmp_path, chunk_shots):
    shots = some_shots(300)
    files.write_chunks(
        tmp_path / "shots.parquet",
        (files.part(shots, at, at + 100) for at in range(0, 300, 100)),
    )
    chunks = list(files.iterate(tmp_path / "shots.parquet", chunk_shots))
    assert max(len(chunk) for chunk in chunks) <= chunk_shots
    assert_same(files.concatenate(chunks), shots)


def test_misses_are_rows_of_the_file(tmp_path):
    shots = some_shots()
    files.write(tmp_path / "shots.parquet", shots)
    table = parquet.read_table(tmp_path / "shots.parquet")
    assert table.num_rows == 1000
    lengths = np.array([len(ranges) for ranges in table["range_m"].to_pylist()])
    np.testing.assert_array_equal(lengths, shots.n_returns)
    assert (lengths == 0).any()


def test_directions_and_ranges_lose_less_than_a_micrometre_at_ten_metres(tmp_path):
    angle = np.linspace(0.1, 3.0, 200)
    direction = np.stack([np.sin(angle), np.cos(angle), np.zeros(200)], axis=1)
    exact = Shots(
        np.zeros((200, 3)),
        direction,
        np.ones(200, np.uint16),
        np.arange(201),
        10.0 - angle / 7,
        np.zeros(200, np.float32),
        np.zeros(200, np.float32),
        np.zeros(3),
    )
    files.write(tmp_path / "shots.parquet", exact)
    found = files.read(tmp_path / "shots.parquet")
    assert np.abs(found.return_xyz_m - exact.return_xyz_m).max() < 1e-6


def test_the_head_tells_positions_origin_and_facts(tmp_path):
    shots = some_shots()
    files.write(tmp_path / "shots.parquet", shots, {"angular_step_deg": 0.04})
    head = files.read_head(tmp_path / "shots.parquet")
    assert head["n_shots"] == 1000
    assert head["facts"] == {"angular_step_deg": 0.04}
    np.testing.assert_array_equal(head["scan_positions_m"][1], PLACES[0])
    np.testing.assert_array_equal(head["scan_positions_m"][2], PLACES[1])
    np.testing.assert_array_equal(head["world_origin_m"], shots.world_origin_m)


def test_returns_become_points_where_the_beam_met_something():
    shots = some_shots()
    cloud = files.to_cloud(shots)
    assert len(cloud) == shots.n_returns.sum()
    i = int(np.flatnonzero(shots.n_returns == 3)[0])
    rows = slice(shots.first[i], shots.first[i + 1])
    np.testing.assert_array_equal(cloud.attributes["ReturnNumber"][rows], [1, 2, 3])
    np.testing.assert_array_equal(cloud.attributes["NumberOfReturns"][rows], [3, 3, 3])
    np.testing.assert_array_equal(cloud.attributes["PointSourceId"][rows], [shots.scan[i]] * 3)
    np.testing.assert_array_equal(cloud.attributes["TrueClass"], shots.truth)
    assert "Classification" not in cloud.attributes
    distance = np.linalg.norm(cloud.xyz_m[rows] - shots.origin_m[i], axis=1)
    np.testing.assert_allclose(distance, shots.range_m[rows], rtol=1e-6)
    np.testing.assert_array_equal(cloud.origin_m, shots.world_origin_m)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.parquet: found no such file"):
        files.read(tmp_path / "nowhere.parquet")


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.95])
def test_a_truncated_file_is_named(tmp_path, keep):
    path = tmp_path / "cut.parquet"
    files.write(path, some_shots())
    whole = path.read_bytes()
    path.write_bytes(whole[: int(keep * len(whole))])
    with pytest.raises(InputError, match=r"cut\.parquet: found a damaged file"):
        files.read(path)


def test_a_table_of_something_else_is_not_taken_for_shots(tmp_path):
    parquet.write_table(pa.table({"x": [1.0]}), tmp_path / "other.parquet")
    with pytest.raises(InputError, match=r"other\.parquet: found no column .*range_m"):
        files.read(tmp_path / "other.parquet")


def test_a_writer_that_fails_leaves_no_file(tmp_path):
    def chunks():
        yield some_shots()
        raise RuntimeError("the scanner broke")

    with pytest.raises(RuntimeError, match="broke"):
        files.write_chunks(tmp_path / "shots.parquet", chunks())
    assert list(tmp_path.iterdir()) == []


def test_nothing_to_write_is_an_error(tmp_path):
    with pytest.raises(InputError, match="no shots"):
        files.write_chunks(tmp_path / "shots.parquet", [])
    assert list(tmp_path.iterdir()) == []


def test_a_scan_that_moves_cannot_be_written(tmp_path):
    shots = some_shots()
    moving = Shots(
        shots.origin_m + np.arange(1000)[:, None],
        *(getattr(shots, name) for name in FIELDS[1:]),
    )
    with pytest.raises(InputError, match="more than one place"):
        files.write(tmp_path / "shots.parquet", moving)
