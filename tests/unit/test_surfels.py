"""Leaves as discs: on the surfaces that points lie on, and as open as shots found them."""

import numpy as np
import pytest

from dapple.config.surfels import Surfels
from dapple.errors import EmptyCloudError
from dapple.formats.shots import Shots
from dapple.structure import shot_evidence, surfels

THIN = {"beam_diameter_m": 0.0, "beam_divergence_mrad": 0.0}
SETTINGS = Surfels().model_dump() | THIN | {"max_deviation": 15.0, "seed": 1}
SCANNER_M = np.array([0.0, 0.0, 4.0])
EDGE_M = 0.4


def sheet(height_m=0.0, noise_m=0.003, seed=0, step_m=0.008):
    """Points on a level square, in a jittered grid, with noise across it."""
    rng = np.random.default_rng(seed)
    line = np.arange(-EDGE_M / 2, EDGE_M / 2, step_m)
    x, y = (c.ravel() for c in np.meshgrid(line, line))
    points = np.column_stack([x, y, np.full(len(x), height_m)])
    points[:, :2] += rng.uniform(0, step_m, (len(x), 2))
    points[:, 2] += rng.normal(0, noise_m, len(x))
    return points


def shots_down(returns_of, step_m=0.004, position_m=SCANNER_M, deviation=0.0):
    """Shots from above at a level square; `returns_of(k)`: heights of the returns of shot k."""
    line = np.arange(-EDGE_M / 2, EDGE_M / 2, step_m) + step_m / 2
    x, y = (c.ravel() for c in np.meshgrid(line, line))
    to = np.column_stack([x, y, np.zeros(len(x))]) - position_m
    length = np.linalg.norm(to, axis=1)
    heights = [returns_of(k) for k in range(len(x))]
    ranges = np.array(
        [
            (position_m[2] - z) / position_m[2] * length[k]
            for k, own in enumerate(heights)
            for z in own
        ]
    )
    same = np.full(len(ranges), deviation, np.float32)
    return Shots(
        np.broadcast_to(position_m, to.shape).copy(),
        to / length[:, None],
        np.ones(len(x), np.uint16),
        np.concatenate([[0], np.cumsum([len(own) for own in heights])]),
        ranges,
        same,
        same,
        np.zeros(3),
    )


def rebuilt(points, shots=None, **settings):
    given = None if shots is None else [shots]
    return surfels.reconstruct(points, given, **SETTINGS | settings)


def test_a_noisy_sheet_gets_its_area_and_its_direction():
    leaves, facts = rebuilt(sheet())
    assert leaves.area_m2 == pytest.approx(SETTINGS["overlap"] * EDGE_M**2, rel=0.1)
    assert np.median(leaves.tilt_deg) < 5
    assert np.percentile(leaves.tilt_deg, 95) < 15
    assert not facts["with_shots"]


def test_points_are_drawn_onto_their_surface():
    away = rebuilt(sheet(noise_m=0.005))[0].element_centre_m[:, 2]
    assert np.sqrt(np.mean(away**2)) < 0.6 * 0.005


def test_two_sheets_near_each_other_stay_two():
    both = np.concatenate([sheet(0.0, 0.002), sheet(0.025, 0.002, seed=1)])
    height = rebuilt(both)[0].element_centre_m[:, 2]
    assert np.percentile(np.minimum(abs(height), abs(height - 0.025)), 99) < 0.006
    assert (height > 0.0125).mean() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("behind", [(), (-1.0,)], ids=["misses", "later returns"])
def test_a_layer_that_half_of_the_shots_pass_has_half_the_area(behind):
    closed = rebuilt(sheet(), shots_down(lambda k: (0.0,)))[0].area_m2
    half, facts = rebuilt(sheet(), shots_down(lambda k: (0.0,) if k % 2 else behind))
    assert facts["with_shots"]
    assert half.area_m2 == pytest.approx(0.5 * closed, rel=0.05)


def test_a_layer_that_all_shots_end_at_is_as_without_shots():
    closed = rebuilt(sheet(), shots_down(lambda k: (0.0,)))[0].area_m2
    assert closed == pytest.approx(rebuilt(sheet())[0].area_m2)


def test_shots_that_end_before_a_layer_say_nothing_about_it():
    blocked = shots_down(lambda k: (1.0,))
    assert rebuilt(sheet(), blocked)[0].area_m2 == pytest.approx(rebuilt(sheet())[0].area_m2)


def test_a_return_before_a_layer_leaves_a_share_of_the_beam_to_tell():
    shared = shots_down(lambda k: (1.0, 0.0) if k % 2 else ())
    # Half a beam ended at the layer for every whole one that passed.
    share = rebuilt(sheet(), shared)[1]["hit_share"]
    assert share == pytest.approx(1 / 3, rel=0.05)


def test_mixed_returns_are_of_no_place():
    mixed = shots_down(lambda k: (-0.2,), deviation=20.0)
    assert rebuilt(sheet(), mixed)[0].area_m2 == pytest.approx(rebuilt(sheet())[0].area_m2)


def test_a_scanner_that_moves_tells_nothing_and_the_facts_say_so():
    shots = shots_down(lambda k: ())
    shots.origin_m[:, 0] += np.linspace(0, 1, len(shots))
    assert not rebuilt(sheet(), shots)[1]["with_shots"]


def test_a_beam_that_passed_was_clear_of_leaves_all_across():
    """Beams of 2 cm at half of the square: they end beside it too, and pass farther away."""
    points, thick = sheet(), {"beam_diameter_m": 0.02, "beam_divergence_mrad": 0.0}
    reach_m = 0.01 * surfels.BEAM_SHARE
    line = np.arange(-EDGE_M / 2, EDGE_M / 2, 0.004) + 0.002
    is_hit = np.repeat(line < reach_m, len(line)).reshape(len(line), -1).T.ravel()
    shots = shots_down(lambda k: (0.0,) if is_hit[k] else ())
    seen = points[points[:, 0] < reach_m]
    area = {
        name: rebuilt(seen, shots, spacing_m=0.005, **beam)[0].area_m2
        for name, beam in (("thin", THIN), ("thick", thick))
    }
    beyond = np.mean(seen[:, 0] > 0)
    assert 0.5 * beyond < 1 - area["thick"] / area["thin"] < 2 * beyond


def test_all_shots_that_meet_a_disc_are_found():
    shots = shots_down(lambda k: (0.0,), position_m=np.array([2.0, -3.0, 1.5]))
    index = shot_evidence.build([shots], 15.0)
    centre, normal = np.array([0.05, 0.02, 0.0]), np.array([0.1, -0.2, 1.0])
    normal /= np.linalg.norm(normal)
    u, v, out = np.empty(3), np.empty(3), np.empty((999, 6))
    shot_evidence.axes_in(normal, u, v)
    count = shot_evidence.gather(index.arrays, centre, normal, u, v, 0.03, 1.0, out)
    to = centre - shots.origin_m
    t = (to @ normal) / (shots.direction @ normal)
    met = shots.origin_m + t[:, None] * shots.direction
    expected = (np.linalg.norm(met - centre, axis=1) < 0.03).sum()
    assert expected > 30
    assert abs(count - expected) <= 1  # directions are kept in single precision


def test_places_of_shots_on_a_disc_are_told_in_its_own_plane():
    shots = shots_down(lambda k: (0.0,), position_m=np.array([2.0, -3.0, 1.5]))
    index = shot_evidence.build([shots], 15.0)
    centre, normal = np.array([0.05, 0.02, 0.0]), np.array([1.0, -2.0, 3.0]) / np.sqrt(14.0)
    u, v, out = np.empty(3), np.empty(3), np.empty((999, 6))
    shot_evidence.axes_in(normal, u, v)
    made = shot_evidence.gather(index.arrays, centre, normal, u, v, 0.03, 1.0, out)
    to = centre - shots.origin_m
    reach = (to @ normal) / (shots.direction @ normal)
    away = shots.origin_m + reach[:, None] * shots.direction - centre
    near = np.linalg.norm(away, axis=1) < 0.03
    expected = away[near] @ np.stack([u, v], axis=1)
    found = out[:made, [shot_evidence.U, shot_evidence.V]]
    for axis in (0, 1):
        assert found[:, axis].min() == pytest.approx(expected[:, axis].min(), abs=1e-3)
        assert found[:, axis].max() == pytest.approx(expected[:, axis].max(), abs=1e-3)
    assert np.linalg.norm(found, axis=1).max() < 0.03 + 1e-6


def test_a_sheet_that_is_seen_at_grazing_angles_alone_is_told_to_be_edge_on():
    above, beside = (
        rebuilt(sheet(), shots_down(lambda k: (0.0,), position_m=np.array(place)))[1]
        for place in ((0.0, 0.0, 4.0), (4.0, 0.0, 1.0))
    )
    assert above["edge_on_share"] < 0.02
    assert beside["edge_on_share"] > 0.95
    assert surfels.doubts(above, "tree.laz") == []
    (doubt,) = surfels.doubts(beside, "tree.laz")
    assert "scan from above" in doubt.remedy


def test_without_shots_nobody_knows_how_leaves_were_seen():
    assert surfels.doubts(rebuilt(sheet())[1], "tree.laz") == []


def test_points_alone_have_discs_turned_by_chance():
    lonely = np.random.default_rng(1).uniform(0, 10, (400, 3))
    leaves, facts = rebuilt(lonely)
    assert facts["without_surface"] == 1
    assert np.mean(np.abs(leaves.element_normal[:, 2])) == pytest.approx(0.5, abs=0.05)


def test_the_same_seed_gives_the_same_discs():
    one, two = (rebuilt(sheet(), shots_down(lambda k: (0.0,)))[0] for _ in range(2))
    assert one.vertices_m.tobytes() == two.vertices_m.tobytes()


def test_no_leaf_point_is_an_error():
    with pytest.raises(EmptyCloudError):
        rebuilt(np.empty((0, 3)))
