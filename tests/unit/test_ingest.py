"""A scan whose empty shots were never written gets them back, where and only where they were."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dapple import frames
from dapple.cloud import ingest, lattice, ordered, selection, shot_sources
from dapple.cloud.lattice import ScanFrame
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import clouds
from dapple.formats.clouds import Cloud

TILT = (1.1, -0.7, 48.0)
FRAME = ScanFrame(301, 180, (30.0, 120.0), (0.0, 358.0), TILT)
SCANNER = np.array([3.0, -2.0, 1.5])


def fire(collimation_deg=0.8, phase=True, frame=FRAME, seed=3):
    """Directions (lines, rows, 3) in the local frame of a scanner that is not quite square."""
    rng = np.random.default_rng(seed)
    shape = (frame.n_azimuth, frame.n_zenith)
    zenith = np.radians(np.linspace(*frame.zenith_deg, frame.n_zenith))[None, :]
    zenith = zenith + (rng.uniform(-0.5, 0.5, (shape[0], 1)) if phase else 0) * frame.zenith_step
    azimuth = np.radians(np.linspace(*frame.azimuth_deg, frame.n_azimuth))[:, None]
    azimuth = azimuth + np.radians(collimation_deg) / np.sin(zenith)
    sine, zenith = np.broadcast_to(np.sin(zenith), shape), np.broadcast_to(zenith, shape)
    scanner = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(zenith)], axis=-1)
    return scanner @ frame.rotation.T


def trees(direction):
    """Distance to a ring of crowns with gaps, and to the ground; inf where nothing is met."""
    zenith, azimuth = frames.angles_from_direction(direction)
    crown = np.sin(np.radians(7 * azimuth)) + np.cos(np.radians(9 * zenith)) > 0.4
    distance = np.where(crown, 6 + 2 * np.sin(np.radians(3 * azimuth + zenith)), np.inf)
    down = -direction[..., 2]
    ground = np.where(down > 0.04, 1.5 / np.maximum(down, 0.04), np.inf)
    return np.minimum(distance, ground)


def scanned(direction, rounded_m=0.001):
    distance = trees(direction)
    hit = np.isfinite(distance)
    xyz = SCANNER + direction[hit] * distance[hit, None]
    return Cloud(np.round(xyz / rounded_m) * rounded_m), hit


@pytest.fixture(scope="module")
def rebuilt():
    """True directions, which of them met something, the points, and what was rebuilt of them."""
    direction = fire(collimation_deg=0.8)
    cloud, hit = scanned(direction)
    return direction, hit, cloud, *ingest.shots_from_scan(cloud, SCANNER, FRAME, scan=4)


def test_the_empty_shots_come_back_in_their_number_and_direction(rebuilt):
    direction, hit, cloud, shots, facts = rebuilt
    assert facts["n_returns"] == len(cloud)
    assert facts["n_shots"] == pytest.approx(hit.size, rel=0.003)
    found = shots.direction[shots.n_returns == 0]
    true = direction[~hit]
    assert len(found) == pytest.approx(len(true), rel=0.01)
    off_deg = np.degrees(cKDTree(found).query(true)[0])
    assert np.percentile(off_deg, 99) < 0.1  # a third of a zenith step, a twentieth of a line
    off_deg = np.degrees(cKDTree(true).query(found)[0])
    assert np.percentile(off_deg, 99) < 0.1


def test_returns_stay_where_they_were(rebuilt):
    _, _, cloud, shots, _ = rebuilt
    assert np.linalg.norm(shots.direction, axis=1) == pytest.approx(1.0)
    order = [np.lexsort(np.round(xyz, 6).T) for xyz in (cloud.xyz_m, shots.return_xyz_m)]
    assert shots.return_xyz_m[order[1]] == pytest.approx(cloud.xyz_m[order[0]], abs=1e-9)
    assert set(shots.scan) == {4}


def test_the_axes_of_the_scanner_are_found_from_the_points(rebuilt):
    facts = rebuilt[-1]
    assert facts["collimation_deg"] == pytest.approx(0.8, abs=0.05)
    assert facts["azimuth_step_deg"] == pytest.approx(2.0, rel=1e-3)
    assert facts["zenith_step_deg"] == pytest.approx(0.3, rel=1e-3)
    assert facts["tilt_correction_deg"] < 0.02


def test_returns_of_one_shot_are_grouped_near_to_far():
    direction = fire()
    cloud, hit = scanned(direction)
    behind = cloud.xyz_m + 0.7 * direction[hit]
    double = np.arange(len(cloud)) % 3 == 0
    n = np.where(double, 2, 1).astype(np.uint8)
    both = Cloud(
        np.concatenate([behind[double], cloud.xyz_m]),
        attributes={
            "ReturnNumber": np.concatenate([np.full(double.sum(), 2), np.ones(len(cloud), int)]),
            "NumberOfReturns": np.concatenate([n[double], n]),
            "Reflectance": np.concatenate([np.full(double.sum(), -9.0), np.full(len(cloud), -5)]),
        },
    )
    shots, facts = ingest.shots_from_scan(both, SCANNER, FRAME)
    n_returns = np.bincount(shots.n_returns, minlength=3)
    assert n_returns[1:] == pytest.approx([(~double).sum(), double.sum()], rel=0.005)
    pair = np.flatnonzero(shots.n_returns == 2)
    near, far = shots.first[pair], shots.first[pair] + 1
    assert shots.range_m[far] - shots.range_m[near] == pytest.approx(0.7, abs=0.01)
    assert set(shots.reflectance_db[near]) == {-5}
    assert facts["share_of_shots_with_clipped_returns"] == pytest.approx(0, abs=0.003)


def test_no_return_towards_the_ground_is_an_obstacle_and_not_a_gap():
    direction = fire()
    distance = trees(direction)
    zenith, azimuth = frames.angles_from_direction(direction)
    leg = (np.abs(azimuth - 120) < 15) & (zenith > 104)
    hit = np.isfinite(distance) & ~leg
    cloud = Cloud(SCANNER + direction[hit] * distance[hit, None])
    shots, facts = ingest.shots_from_scan(cloud, SCANNER, FRAME)
    assert facts["n_blocked"] == pytest.approx(leg.sum(), rel=0.02)
    miss_zenith, _ = frames.angles_from_direction(shots.direction[shots.n_returns == 0])
    assert miss_zenith.max() <= 100.0


@pytest.mark.parametrize(
    "wrong",
    [
        ScanFrame(301, 207, (30.0, 120.0), (0.0, 358.0), TILT),
        ScanFrame(225, 180, (30.0, 120.0), (0.0, 358.0), TILT),
    ],
    ids=["too many lines", "too few rows"],
)
def test_a_frame_that_is_not_the_scans_is_refused(rebuilt, wrong):
    cloud = rebuilt[2]
    with pytest.raises(InputError, match=r"scan.laz: found points that lie 0\.\d+ steps"):
        ingest.shots_from_scan(cloud, SCANNER, wrong, source="scan.laz")


def test_a_tilt_of_the_wrong_sign_is_refused(rebuilt):
    wrong = ScanFrame(301, 180, (30.0, 120.0), (0.0, 358.0), (-1.1, 0.7, 48.0))
    with pytest.raises(InputError, match=r"tilted by 2\.\d+° .*roll about x"):
        ingest.shots_from_scan(rebuilt[2], SCANNER, wrong)


def test_a_scanner_in_the_wrong_place_is_refused(rebuilt):
    cloud = rebuilt[2]
    with pytest.raises(InputError, match="scanner's position"):
        ingest.shots_from_scan(cloud, SCANNER + 0.5, FRAME)


def test_a_handful_of_points_is_no_scan():
    with pytest.raises(EmptyCloudError, match="10 points"):
        ingest.shots_from_scan(Cloud(np.ones((10, 3))), np.zeros(3), FRAME)


def test_every_row_is_taken_once_and_moves_no_further_than_it_must():
    line = np.array([0, 0, 0, 0, 1, 1])
    position = np.array([4.9, 5.1, 5.2, 9.0, 5.0, 5.4])
    row = lattice.distinct_rows(line, position, np.ones(6))
    assert row.tolist() == [4, 5, 6, 9, 5, 6] or row.tolist() == [4, 5, 6, 9, 4, 5]


# --- ordered scans --------------------------------------------------------------------------

COLUMNS, ROWS = 72, 40


def write_ptx(path, hit, position=(410505.0, 5317088.0, 290.0), noise_deg=0.0, colours=""):
    """A scan of a sphere of 5 m with 5° columns and 2.5° rows; returns its true directions."""
    rng = np.random.default_rng(5)
    azimuth = np.radians(350.0 - 5.0 * np.arange(COLUMNS))[:, None] + np.zeros((1, ROWS))
    zenith = np.radians(125.0 - 2.5 * np.arange(ROWS))[None, :] + np.zeros((COLUMNS, 1))
    azimuth = azimuth + np.radians(noise_deg) * rng.normal(size=azimuth.shape)
    direction = np.stack(
        [np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)], -1
    )
    rotation = frames.scanner_rotation(0, 0, 30)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = rotation.T, position
    head = [f"{COLUMNS}", f"{ROWS}", " ".join(map(repr, position))]
    head += [" ".join(map(str, axis)) for axis in rotation.T]
    head += [" ".join(repr(float(v)) for v in row) for row in matrix]
    shots = np.where(hit[..., None], 5 * direction, 0.0).reshape(-1, 3)
    body = [f"{x:.6f} {y:.6f} {z:.6f} 0.5{colours}" for x, y, z in shots]
    path.write_text("\n".join([*head, *body]) + "\n")
    return direction @ rotation.T


def all_shots(path, **options):
    """Shots of a file of one scan, around the origin of its cloud, and their facts."""
    ((shots, facts),) = ordered.shots_from_file(path, clouds.read(path).origin_m, **options)
    return shots, facts


def window(columns=(0, COLUMNS), rows=(0, ROWS)):
    hit = np.zeros((COLUMNS, ROWS), bool)
    hit[slice(*columns), slice(*rows)] = True
    return hit


@pytest.mark.parametrize(
    "hit",
    [
        window(),
        window() & (np.arange(ROWS) % 3 > 0),
        window(rows=(0, 22)),
        window(columns=(15, 50), rows=(5, 30)),
        window(columns=(0, 20)) | window(columns=(60, 72)),
    ],
    ids=["all", "holes", "sky above", "empty borders", "empty middle"],
)
def test_directions_of_empty_ptx_shots_follow_the_grid_even_at_empty_borders(tmp_path, hit):
    direction = write_ptx(tmp_path / "a.ptx", hit)
    shots, facts = all_shots(tmp_path / "a.ptx", lowest_miss_zenith_deg=180)
    assert facts["n_misses"] == (~hit).sum()
    off = np.degrees(np.linalg.norm(shots.direction - direction.reshape(-1, 3), axis=1))
    assert off.max() < 0.01


def test_noisy_ptx_directions_do_not_tilt_the_extrapolation(tmp_path):
    hit = window(columns=(15, 60), rows=(5, 30))
    rng = np.random.default_rng(2)
    hit[15] = hit[59] = rng.random(ROWS) < 0.2  # thin outer columns
    direction = write_ptx(tmp_path / "a.ptx", hit, noise_deg=0.3)
    shots, _ = all_shots(tmp_path / "a.ptx", lowest_miss_zenith_deg=180)
    off = np.degrees(np.linalg.norm(shots.direction - direction.reshape(-1, 3), axis=1))
    assert np.percentile(off, 99) < 1.5  # their own scatter, of a 5° step


def test_ptx_shots_and_points_share_origin_and_place(tmp_path):
    write_ptx(tmp_path / "a.ptx", window(rows=(0, 22)), colours=" 10 20 30")
    shots, _ = all_shots(tmp_path / "a.ptx")
    cloud = clouds.read(tmp_path / "a.ptx")
    assert np.array_equal(shots.world_origin_m, cloud.origin_m)
    assert shots.return_xyz_m == pytest.approx(cloud.xyz_m, abs=1e-5)
    assert set(cloud.attributes["Green"]) == {20}
    assert (shots.origin_m + shots.world_origin_m)[0] == pytest.approx([410505, 5317088, 290])


@pytest.mark.parametrize(("unit", "unit_m"), [("m", 1.0), ("ft", 0.3048)])
@pytest.mark.parametrize("up", ["z", "y", "-z"])
def test_shots_turn_and_grow_with_their_points(tmp_path, unit, unit_m, up):
    position = np.array([12.0, 7.0, 1.6])
    hit = window(rows=(0, 22), columns=(0, 50))
    write_ptx(tmp_path / "a.ptx", hit, position=(selection.UP[up].T @ position / unit_m).tolist())
    taken = selection.take(
        *clouds.read_with_source(tmp_path / "a.ptx"), tmp_path / "a.ptx", unit=unit, up=up
    )
    fired, _ = shot_sources.open_shots(
        tmp_path / "a.ptx", *taken, how="auto", positions="", scan_frame={}, up=up
    )
    ((shots, _),) = fired
    cloud, source = taken
    assert shots.return_xyz_m == pytest.approx(cloud.xyz_m, abs=1e-5)
    assert (shots.origin_m + shots.world_origin_m)[0] == pytest.approx(position, abs=1e-5)
    assert source.scans[0].position_m == pytest.approx(position, abs=1e-5)
    assert shots.range_m == pytest.approx(5 * unit_m, abs=1e-5)
    misses = shots.direction[shots.n_returns == 0]
    assert misses[:, 2].min() >= np.cos(np.radians(100.0)) - 1e-9  # below stood what it stood on


def test_a_shot_without_return_may_be_no_number(tmp_path):
    write_ptx(tmp_path / "a.ptx", window(rows=(0, 22)))
    text = (tmp_path / "a.ptx").read_text()
    noughts = " ".join(["0.000000"] * 3)
    (tmp_path / "b.ptx").write_text(text.replace(f"\n{noughts} 0.5", "\nnan nan nan 0.5"))
    (one, _), (other, _) = (all_shots(tmp_path / f"{name}.ptx") for name in "ab")
    assert np.array_equal(one.direction, other.direction)
    assert (other.n_returns == 0).sum() > 0


def test_a_ptx_that_is_no_grid_is_refused(tmp_path):
    write_ptx(tmp_path / "a.ptx", window(), noise_deg=8.0)
    with pytest.raises(InputError, match=r"a.ptx, scan 1: found azimuth .* off its grid"):
        all_shots(tmp_path / "a.ptx")
