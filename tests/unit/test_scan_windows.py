"""The frame of a scan is found from its points when no more is known than where it stood."""

import numpy as np
import pandas as pd
import pytest
from tests.unit.test_ingest import SCANNER, trees

from dapple import frames
from dapple.cloud import scan_steps, scan_windows, shot_sources
from dapple.errors import InputError, MissingMissesError
from dapple.formats import clouds
from dapple.formats.cloud_raw import ScanFacts, Source
from dapple.formats.clouds import Cloud

PLACES = np.array([SCANNER, SCANNER + np.array([0.4, -0.3, 1.0])])
STEP_DEG = 1.0


def angles(step_deg=STEP_DEG):
    """Zenith and azimuth (lines, rows) of a level scanner [rad]."""
    zenith = np.radians(np.arange(30, 120.1, step_deg))
    azimuth = np.radians(np.arange(0, 360, step_deg))
    return np.meshgrid(zenith, azimuth)


def scanned(place, step_deg=STEP_DEG, tilt_deg=(0.0, 0.0, 0.0)):
    """Points of one scan, and the number of its shots that met nothing."""
    zenith, azimuth = angles(step_deg)
    sine = np.sin(zenith)
    direction = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(zenith)], -1)
    direction = direction @ frames.scanner_rotation(*tilt_deg).T
    distance = trees(direction)
    hit = np.isfinite(distance)
    return place + direction[hit] * distance[hit, None], int((~hit).sum())


def scans(**options):
    """Two scans as one cloud without numbers, the number of each point, and the misses of each."""
    points, empty = zip(*(scanned(place, **options) for place in PLACES), strict=True)
    number = np.repeat([1, 2], [len(xyz) for xyz in points])
    return np.concatenate(points), number, empty


def table(**columns):
    return pd.DataFrame(PLACES, columns=["x_m", "y_m", "z_m"]).assign(position=[1, 2], **columns)


def misses(cloud, positions):
    found = scan_windows.rebuild(cloud, positions, lowest_miss_zenith_deg=180.0)
    return {fact["scan"]: int((shots.n_returns == 0).sum()) for shots, fact in found}


def minutes(number):
    """GPS time: ten seconds a scan, five minutes between scans, not in the order of the points."""
    return 300.0 * number + np.random.default_rng(4).uniform(0, 10, len(number))


@pytest.mark.parametrize(
    "attribute",
    [lambda k: {"PointSourceId": k}, lambda k: {"GpsTime": minutes(k)}],
    ids=["id", "t"],
)
def test_empty_shots_of_level_scanners_come_back_from_their_places_alone(attribute):
    xyz, number, empty = scans()
    found = misses(Cloud(xyz, attributes=attribute(number)), table())
    assert list(found) == [1, 2]
    assert list(found.values()) == pytest.approx(empty, rel=0.02)


def test_a_tilt_that_the_table_states_is_taken_out():
    tilt = (4.0, -3.0, 40.0)
    xyz, number, empty = scans(tilt_deg=tilt)
    columns = dict(zip(scan_windows.TILT, tilt, strict=True))
    cloud = Cloud(xyz, attributes={"PointSourceId": number})
    assert list(misses(cloud, table(**columns)).values()) == pytest.approx(empty, rel=0.02)
    with pytest.raises(InputError, match="scan 1: found directions without a regular step"):
        misses(cloud, table())


@pytest.mark.parametrize("step_deg", [0.25, 0.7, 1.3, 2.4, 3.0, 5.0])
def test_the_steps_between_shots_are_read_from_the_points(step_deg):
    xyz, _ = scanned(SCANNER, step_deg)
    frame = scan_windows.frame_of(xyz - SCANNER, (0.0, 0.0, 0.0), "a.laz")
    assert np.degrees(frame.azimuth_step) == pytest.approx(step_deg, rel=2e-3)
    assert np.degrees(frame.zenith_step) == pytest.approx(step_deg, rel=2e-3)


def test_directions_by_chance_have_no_step():
    azimuth = np.random.default_rng(2).uniform(0, 2 * np.pi, 20_000)
    assert np.isnan(scan_steps.find_azimuth_step(azimuth))


def test_a_scan_of_a_few_points_is_skipped_with_a_word():
    xyz, number, _ = scans()
    few = (number == 1) | (np.cumsum(number == 2) <= 50)
    cloud = Cloud(xyz[few], attributes={"PointSourceId": number[few]})
    facts = [fact for _, fact in scan_windows.rebuild(cloud, table())]
    assert facts[1] == {"scan": 2, "skipped": "50 points: the frame does not show"}


def test_scans_without_a_place_and_points_without_a_scan_are_refused():
    xyz, number, _ = scans()
    cloud = Cloud(xyz, attributes={"PointSourceId": number})
    with pytest.raises(InputError, match=r"points of scans \[2\] and places of scans \[1\]"):
        misses(cloud, table().iloc[:1])
    with pytest.raises(InputError, match="points that do not say which of them they are from"):
        misses(Cloud(xyz), table())


# --- the table of positions -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "position"),
    [
        ("x,y,z\n100,200,3\n101,200,3\n", [1, 2]),
        ("position;X;Y;Z\n7;100;200;3\n9;101;200;3\n", [7, 9]),
        ("scan,easting,northing,height,roll_deg\n2,100,200,3,1\n1,101,200,3,-1\n", [2, 1]),
    ],
)
def test_positions_are_read_into_the_local_frame(tmp_path, text, position):
    (tmp_path / "positions.csv").write_text(text)
    found = scan_windows.read_positions(tmp_path / "positions.csv", np.array([100.0, 200.0, 0.0]))
    assert found["position"].tolist() == position
    assert found[["x_m", "y_m", "z_m"]].to_numpy() == pytest.approx(
        np.array([[0, 0, 3], [1, 0, 3]]), abs=1e-9
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z\n", "no row"),
        ("x,y,z\n1,2,\n", "rows without all numbers"),
        ("position,x,y,z\n1,1,2,3\n1,4,5,6\n", "a position twice"),
        ("x,y\n1,2\n", "scan positions"),
    ],
)
def test_a_table_of_positions_that_cannot_be_used_says_why(tmp_path, text, message):
    (tmp_path / "positions.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        scan_windows.read_positions(tmp_path / "positions.csv", np.zeros(3))


# --- what a file offers ---------------------------------------------------------------------


def opened(path, cloud, source=None, how="auto", positions=""):
    source = source or Source()
    return shot_sources.open_shots(path, cloud, source, how=how, positions=positions, scan_frame={})


def test_places_that_the_file_states_need_no_table(tmp_path):
    xyz, number, _ = scans()
    cloud = Cloud(xyz, attributes={"PointSourceId": number})
    facts = tuple(ScanFacts(k, place, 5000, None) for k, place in enumerate(PLACES, 1))
    clouds.write(tmp_path / "a.laz", cloud)
    found, moving = opened(tmp_path / "a.laz", cloud, Source(scans=facts))
    assert not moving
    assert [fact["scan"] for _, fact in found] == [1, 2]


def test_a_file_that_states_how_scanners_stood_needs_no_table_of_their_tilt(tmp_path):
    tilt = (2.0, -3.0, 40.0)
    xyz, number, empty = scans(tilt_deg=tilt)
    cloud = Cloud(xyz, attributes={"PointSourceId": number})
    turn = frames.scanner_rotation(*tilt)
    facts = tuple(ScanFacts(k, place, 5000, None, turn) for k, place in enumerate(PLACES, 1))
    clouds.write(tmp_path / "a.laz", cloud)
    table = shot_sources.places_of(Source(scans=facts), "", cloud.origin_m)
    assert scan_windows.tilt_of(table.iloc[1].to_dict()) == pytest.approx(tilt)
    found, _ = opened(tmp_path / "a.laz", cloud, Source(scans=facts))
    stated = {fact["scan"]: fact["n_misses"] for _, fact in found}
    assert stated[1] == pytest.approx(empty[0], abs=0.4 * empty[0])
    assert stated == {
        fact["scan"]: fact["n_misses"]
        for _, fact in scan_windows.rebuild(
            cloud, pd.DataFrame(PLACES, columns=["x_m", "y_m", "z_m"]).assign(
                position=[1, 2], roll_deg=2.0, pitch_deg=-3.0, yaw_deg=40.0
            )
        )
    }  # fmt: skip


def test_points_without_places_have_no_shots(tmp_path):
    cloud = Cloud(scanned(SCANNER)[0])
    clouds.write(tmp_path / "a.laz", cloud)
    with pytest.raises(MissingMissesError, match="scan_positions"):
        opened(tmp_path / "a.laz", cloud)
