"""What the check of an input says of scans: their scanner, their shots, and which lost returns."""

import dataclasses

import numpy as np
import pytest
from tests.unit.test_check import one_tree, settings

from dapple.check import cloud_facts, cloud_findings, page, shots_check
from dapple.check.inspection import inspect
from dapple.formats.cloud_raw import MISSED, ScanFacts, Source
from dapple.formats.clouds import Cloud
from dapple.formats.ordered_scan import OrderedScan
from dapple.structure import traversal


@dataclasses.dataclass
class Sums:
    """Returns of a scan in each voxel, and the free path of its shots there."""

    hits: np.ndarray
    visits: np.ndarray


def scan_of(hits, free_m):
    found = Sums(np.zeros((len(hits), 4)), np.zeros((len(hits), 7)))
    found.hits[:, traversal.N_HITS], found.visits[:, traversal.FREE] = hits, free_m
    return found


def test_scans_that_meet_the_same_density_have_the_returns_that_the_others_let_expect():
    density = np.array([0.0, 2.0, 5.0])
    paths = {1: np.array([50.0, 100.0, 80.0]), 2: np.array([90.0, 60.0, 70.0])}
    shares = shots_check.shares_of_expected({k: scan_of(density * x, x) for k, x in paths.items()})
    assert shares == pytest.approx({1: 1.0, 2: 1.0})


def test_a_scan_that_lost_half_of_its_returns_has_half_of_those_expected():
    path_m = np.full(3, 200.0)
    sums = {k: scan_of(2.0 * path_m, path_m) for k in (1, 2)} | {3: scan_of(path_m, path_m)}
    shares = shots_check.shares_of_expected(sums)
    assert shares[3] == pytest.approx(0.5)
    assert shares[3] < shots_check.FEW < shares[1]


def test_nothing_is_said_of_one_scan_and_of_few_returns():
    one = scan_of(np.full(3, 400.0), np.full(3, 200.0))
    assert shots_check.shares_of_expected({1: one}) == {}
    few = scan_of(np.full(3, 2.0), np.full(3, 1.0))
    assert set(shots_check.shares_of_expected({1: one, 2: few})) == {1}


def test_a_thinned_scan_is_every_kth_column_and_row_of_the_same_shots():
    column, row = (index.ravel() for index in np.indices((9, 12)))
    scan = OrderedScan(np.column_stack([column, row, row]), column, row, (9, 12), np.eye(3),
                       np.zeros(3), {"Intensity": row})  # fmt: skip
    thin = shots_check.thinned(scan, 27)
    assert thin.shape == (5, 6)
    assert thin.hit.all()
    assert (thin.xyz_m[:, :2] == 2 * np.column_stack([thin.column, thin.row])).all()
    assert (thin.attributes["Intensity"] == 2 * thin.row).all()
    assert shots_check.thinned(scan, 200).shape == scan.shape


def ball_room(scanner_m, n=70, half_deg=18.0):
    """Where shots of a scanner towards the middle meet the first of 1,500 balls of 4 cm; (n, n, 3).

    A shot that meets none is NaN. The balls fill a cube of 2 m, which takes most of the shots.
    """
    balls = np.random.default_rng(3).uniform((-1, -1, 1), (1, 1, 3), (1500, 3))
    towards = np.array([0.0, 0.0, 2.0]) - scanner_m
    east = np.cross(towards, [0, 0, 1.0])
    east /= np.linalg.norm(east)
    slope = np.tan(np.radians(np.linspace(-half_deg, half_deg, n)))
    way = towards / np.linalg.norm(towards) + slope[:, None, None] * east
    way = way + slope[None, :, None] * np.array([0, 0, 1.0])
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    along = way @ (balls - scanner_m).T
    missed_by = ((balls - scanner_m) ** 2).sum(axis=1) - along**2
    with np.errstate(invalid="ignore"):
        range_m = np.where(missed_by < 0.04**2, along - np.sqrt(0.04**2 - missed_by), np.inf)
    nearest = range_m.min(axis=-1)
    return scanner_m + way * np.where(np.isfinite(nearest), nearest, np.nan)[..., None]


def ptx(path, scans):
    """Scans (place, points) as PTX: a shot that met nothing is the scanner's own zero."""
    lines = []
    for place, points in scans:
        lines += [*map(str, points.shape[:2]), " ".join(map(str, place)), "1 0 0", "0 1 0", "0 0 1"]
        lines += ["1 0 0 0", "0 1 0 0", "0 0 1 0", " ".join(map(str, [*place, 1]))]
        local = np.nan_to_num(points - place).reshape(-1, 3)
        lines += [f"{x:.4f} {y:.4f} {z:.4f} 0.5" for x, y, z in local]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_scan_whose_near_returns_were_cut_away_is_named(tmp_path):
    places = [np.array(place) for place in ([0.0, -4.5, 1.8], [4.5, 0.0, 1.8], [-4.5, 0.0, 1.8])]
    whole = [(place, ball_room(place)) for place in places]
    lost = "of the returns that the other scans let expect"
    sound = inspect(settings(), cloud=ptx(tmp_path / "whole.ptx", whole))["findings"]
    assert not [one for one in sound if lost in one["found"]]
    near = whole[2][1][..., 0] < 0.0
    cut = [*whole[:2], (places[2], np.where(near[..., None], np.nan, whole[2][1]))]
    found = inspect(settings(), cloud=ptx(tmp_path / "cut.ptx", cut))["findings"]
    named = [one for one in found if lost in one["found"]]
    assert [one["found"].split(" with ")[0] for one in named] == ["scan 3"]
    assert "Export the scans whole" in named[0]["remedy"]


# What is known of shots that met nothing


def facts(cloud, **source):
    return cloud_facts.gather(cloud, Source(**source), ground_z_m=None)


def scan(number=1, points=900, position=True, shots=None):
    return ScanFacts(number, np.zeros(3) if position else None, points, shots, None)


SCANNERS = {
    "shots told one by one": ({}, {"left_out": {MISSED: 5}}),
    "RIEGL (reflectance and deviation)": ({"Reflectance": -8.0, "Deviation": 3.0}, {}),
    "RIEGL, or another": ({"Reflectance": -8.0}, {}),
    "airborne": ({"NumberOfReturns": 2, "GpsTime": 5.0}, {}),
    "terrestrial, one scan or several": ({}, {"scans": (scan(shots=2000),)}),
    "terrestrial with several returns": ({"NumberOfReturns": 2}, {}),
    "unknown": ({}, {}),
}


@pytest.mark.parametrize("kind", SCANNERS)
def test_a_scanner_is_told_by_what_its_points_carry(kind):
    attributes, source = SCANNERS[kind]
    found = cloud_facts.likely_scanner(one_tree(**attributes), Source(**source))
    assert found.startswith(kind)


@pytest.mark.parametrize(
    ("source", "cloud", "state"),
    [
        ({"scans": (scan(shots=2000),)}, {}, shots_check.RECORDED),
        ({"left_out": {MISSED: 5}}, {}, shots_check.RECORDED),
        ({"scans": (scan(),)}, {}, shots_check.REBUILDABLE),
        ({}, {"scan_positions": "positions.csv"}, shots_check.REBUILDABLE),
        ({"scans": (scan(position=False),)}, {}, shots_check.UNKNOWN),
        ({}, {}, shots_check.UNKNOWN),
    ],
)
def test_shots_that_met_nothing_are_recorded_or_follow_from_where_the_scanner_stood(
    source, cloud, state
):
    given = settings(cloud=cloud)
    assert shots_check.misses(facts(one_tree(), **source), given) == state
    wanted = shots_check.needed(
        facts(one_tree(), **source), {**given, "reconstructions": ["voxels_0.25"]}, "tree.laz"
    )
    remedies = [one.remedy for one in wanted]
    assert bool(remedies) == (state == shots_check.UNKNOWN)
    assert all("Export PTX or a structured E57" in one for one in remedies)


def two_scans():
    cloud = one_tree()
    return Cloud(cloud.xyz_m, attributes={"PointSourceId": np.arange(len(cloud)) % 2 + 1})


def test_one_frame_for_two_scans_is_an_error_with_both_of_them():
    framed = {"cloud": {"shots": "scan_frame"}}
    found = list(shots_check.one_frame(facts(two_scans()), framed, "tree.laz"))
    assert [one.level for one in found] == ["error"]
    assert "1 (4,500 points), 2 (4,500 points)" in found[0].found
    assert "shots: positions" in found[0].yaml
    assert not list(shots_check.one_frame(facts(one_tree()), framed, "tree.laz"))


def test_a_scan_that_saw_almost_nothing_is_told_to_be_left_out():
    scans = {"scans": (scan(1), scan(2, points=3))}
    found = list(shots_check.blind(facts(one_tree(), **scans), "tree.laz"))
    assert [one.found for one in found] == ["scan 2 with 3 returns"]
    alone = {"scans": (scan(1, points=3),)}
    assert not list(shots_check.blind(facts(one_tree(), **alone), "tree.laz"))


def test_many_sources_of_points_are_no_scans():
    """As of a flight that numbers its lines, or of a file that numbers its points."""
    cloud = one_tree()
    many = Cloud(cloud.xyz_m, attributes={"PointSourceId": np.arange(len(cloud))})
    assert facts(many).numbers["scans"] == []
    assert [row["points"] for row in facts(two_scans()).numbers["scans"]] == [4500, 4500]


# What else a cloud shows


def judged(cloud, source=None, **sections):
    found = cloud_findings.judge(facts(cloud, **(source or {})), settings(**sections), "tree.laz")
    return [(one.level, one.found) for one in found]


def reflecting(middle_db):
    """A tree whose reflectances lie 3 dB about a value."""
    cloud = one_tree()
    values = np.linspace(middle_db - 3, middle_db + 3, len(cloud)).astype(np.float32)
    return Cloud(cloud.xyz_m, attributes={"Reflectance": values})


def test_points_far_off_are_told_from_a_plot_that_is_too_wide():
    tree = one_tree().xyz_m
    stray = Cloud(np.concatenate([tree, tree[:5] + np.array([4000.0, 0.0, 0.0])]))
    (said,) = [text for level, text in judged(stray) if level == "warning" and " across" in text]
    whole, core = (float(part.split()[0].replace(",", "")) for part in said.split(", "))
    assert whole > 4000
    assert core < 10


def test_without_reflectance_leaf_and_wood_are_told_by_shape_and_it_is_said():
    auto = {"classify": {"method": "auto"}}
    by_shape = ("note", "no reflectance in dB: leaf and wood are told by shape")
    assert by_shape in judged(one_tree(), **auto)
    assert by_shape in judged(one_tree(Reflectance=3000), **auto)
    assert by_shape not in judged(reflecting(-8.0), **auto)


@pytest.mark.parametrize(("reflectance_db", "side"), [(-14.0, "below"), (-1.0, "above")])
def test_a_threshold_beside_all_reflectances_tells_nothing_apart(reflectance_db, side):
    by_threshold = {"classify": {"method": "reflectance"}}
    said = judged(reflecting(reflectance_db), **by_threshold)
    assert [
        text for level, text in said if level == "warning" and f"all reflectances {side}" in text
    ]


def test_what_was_left_out_is_counted_and_nothing_is_said_of_none():
    said = judged(one_tree(), {"in_file": 9100, "left_out": {"withheld": 100, "synthetic": 0}})
    assert ("note", "100 of 9,100 records left out: withheld") in said
    assert not [text for _, text in said if "synthetic" in text]


# What is printed of it


def test_the_page_tells_where_scans_stood_and_how_many_there_are_besides():
    crs = 'PROJCRS["ETRS89 / UTM zone 32N", and a long rest that nobody reads to its end ]'
    scans = tuple(scan(k, position=k > 1, shots=None if k > 1 else 2000) for k in range(1, 16))
    cloud = one_tree(NumberOfReturns=2)
    found = facts(cloud, scans=scans, crs=crs).numbers
    check = {"experiment": "tree", "findings": [], "misses": "recorded",
             "cloud": {"path": "tree.laz", **found}}  # fmt: skip
    said = page.text(check)
    assert "place unknown, 900 points, 2,000 shots" in said
    assert "at [0.00, 0.00, 0.00], 900 points\n" in said
    assert "… and 3 more scans" in said
    assert "100 % of points from shots with several" in said
    assert "  ETRS89 / UTM zone 32N\n" in said
    assert "<h2>Stems</h2>" in page.page(check)
