"""Stressors make one thing worse, and nothing else; what they do not touch is made once."""

from dataclasses import fields, replace

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats import shots as shot_files
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.light.moved_sensors import sideways
from dapple.sky.sun import position
from dapple.stability import stressors, world
from dapple.stability.chain import Chain, true_conditions
from dapple.stability.stressors import STRESSORS, UNDISTURBED, Conditions
from dapple.stability.world import Setup
from dapple.virtual.plants import apple_tree

PLANT = {
    "height_m": 1.6,
    "crown_base_m": 0.6,
    "crown_radius_m": 0.5,
    "dbh_m": 0.04,
    "leaf_area_m2": 1.0,
    "leaf_length_min_m": 0.05,
    "leaf_length_max_m": 0.08,
}
SETUP = Setup(
    plant=PLANT,
    scan={},
    clean={},
    classify={},
    polygons={},
    surfels={},
    voxels={},
    leaves={},
    sensors={"columns": 3, "rows": 2, "spacing_m": 0.5, "height_m": 0.1},
    site={"latitude_deg": 48.0, "longitude_deg": 7.8, "altitude_m": 230.0},
    time={
        "start": "2023-08-10 10:10",
        "end": "2023-08-10 16:50",
        "step_min": 40.0,
        "timezone": "UTC",
    },
    radiation={"linke_turbidity": 3.0},
    atmosphere={"model": "perez"},
)


def some_shots(n: int = 400, seed: int = 0) -> Shots:
    """Two scans that look at each other's side; every second shot has two returns."""
    rng = np.random.default_rng(seed)
    scan = np.repeat([1, 2], n // 2).astype(np.uint16)
    origin = np.where(scan[:, None] == 1, [[-5.0, 0, 1]], [[5.0, 0, 1]])
    aim = rng.uniform(-1, 1, (n, 3)) + np.array([0, 0, 1.5])
    direction = aim - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    n_returns = np.where(np.arange(n) % 2, 0, 2)
    first = np.concatenate([[0], np.cumsum(n_returns)])
    m = first[-1]
    ranges = 5 + np.tile([0.0, 0.5], m // 2) + 0.1 * rng.random(m)
    values = np.zeros(m, np.float32)
    return Shots(
        origin, direction, scan, first, ranges, values - 8, values, np.zeros(3),
        np.full(m, 4, np.uint8),
    )  # fmt: skip


@pytest.mark.parametrize("stressor", STRESSORS.values(), ids=lambda s: s.name)
def test_a_stressor_has_five_levels_in_order_and_one_of_them_is_harmless(stressor):
    values = [level.value for level in stressor.levels]
    assert len(values) >= 5
    assert values == sorted(set(values))
    assert values.count(stressor.harmless) == 1
    assert len({level.label for level in stressor.levels}) == len(values)


@pytest.mark.parametrize("stressor", STRESSORS.values(), ids=lambda s: s.name)
def test_only_one_thing_is_made_worse(stressor):
    changed = {
        field.name
        for level in stressor.levels
        for field in fields(Conditions)
        if getattr(level.conditions, field.name) != getattr(UNDISTURBED, field.name)
    }
    with_two = {"leaf_size": {"leaf_length_m", "needle_width_m"}}
    with_two |= {"no_reflectance": {"classifier", "has_stem"}}
    assert len(changed) == 1 or changed == with_two[stressor.name]


def test_few_levels_are_the_harmless_one_and_the_extremes():
    assert [level.value for level in STRESSORS["scan_positions"].chosen(2)] == [1, 8]
    assert [level.value for level in STRESSORS["reflectance_drift"].chosen(3)] == [-3, 0, 3]
    assert STRESSORS["wind"].chosen(99) == STRESSORS["wind"].levels


def test_a_stressor_that_there_is_not_is_named():
    with pytest.raises(InputError, match="hail"):
        stressors.find("hail")


def test_what_a_stressor_does_not_touch_is_known_again():
    for name, last_same in (("sensor_position", "structure"), ("clock_offset", "light")):
        worst = STRESSORS[name].levels[-1].conditions
        same = list(stressors.STAGES).index(last_same) + 1
        for k, stage in enumerate(stressors.STAGES):
            equal = stressors.key(worst, stage) == stressors.key(UNDISTURBED, stage)
            assert equal == (k < same)


def test_every_condition_belongs_to_one_stage():
    listed = [name for names in stressors.STAGES.values() for name in names]
    assert sorted(listed) == sorted(field.name for field in fields(Conditions))


def test_a_tree_is_grown_once_for_all_that_leave_it_alone():
    chain = Chain(SETUP, seed=3)
    tree = chain.tree(UNDISTURBED)
    assert chain.tree(Conditions(sensor_error_m=0.1, drift_db=2.0, positions=1)) is tree
    assert chain.tree(Conditions(leaf_area_factor=0.5)) is not tree


def test_a_given_scan_is_not_made_again(monkeypatch):
    chain, scan = Chain(SETUP, seed=3), some_shots()
    monkeypatch.setattr(world, "scan", lambda *_: pytest.fail("scanned again"))
    chain.give("shots", UNDISTURBED, scan, 1.5)
    assert chain.shots(Conditions(clock_offset_min=5.0)) is scan
    assert chain.took_s("shots") == 1.5


def test_the_truth_knows_nothing_of_errors():
    wrong = Conditions(
        leaf_area_factor=2.0, sensor_error_m=0.3, clock_offset_min=10.0, diffuse_share=0.5
    )
    assert true_conditions(wrong) == Conditions(leaf_area_factor=2.0, diffuse_share=0.5)


def test_more_leaf_area_sits_on_the_same_wood():
    one, two = (world.grow(SETUP, Conditions(leaf_area_factor=f), 5) for f in (0.5, 1.0))
    assert two["leaf"].area_m2 == pytest.approx(2 * one["leaf"].area_m2, rel=0.01)
    assert two["wood"].area_m2 == pytest.approx(one["wood"].area_m2, rel=0.35)


def test_needles_have_the_area_of_the_leaves_and_their_own_width():
    leaves = apple_tree(**PLANT, seed=1).leaves
    tufts = world.needles(leaves, 0.002, 0.025, np.random.default_rng(2))
    assert tufts.area_m2 == pytest.approx(leaves.area_m2, abs=5e-5)
    corners = tufts.vertices_m.reshape(-1, 4, 3)
    assert np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1) == pytest.approx(0.002)
    assert np.linalg.norm(corners[:, 2] - corners[:, 1], axis=1) == pytest.approx(0.025)
    # they stay where the leaves were
    assert np.abs(corners.mean(axis=(0, 1)) - leaves.vertices_m.mean(axis=0)).max() < 0.02


def test_wind_moves_leaves_as_far_as_it_should_and_neighbours_together():
    rng = np.random.default_rng(4)
    centre = rng.uniform(-2, 2, (4000, 3))
    centre[1] = centre[0] + 0.005
    pattern = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0]])
    vertices = (centre[:, None] + pattern).reshape(-1, 3)
    leaves = Mesh(
        vertices, np.arange(12_000).reshape(-1, 3).astype(np.int32), np.arange(4000, dtype=np.int32)
    )
    shift = world.in_wind(leaves, 0.1, rng).vertices_m - vertices
    assert np.sqrt((shift**2).sum(axis=1).mean()) == pytest.approx(0.1, rel=0.05)
    assert np.abs(shift[0] - shift[1]).max() < 1e-12  # a leaf is not torn
    assert np.linalg.norm(shift[0] - shift[3]) < 0.02
    assert np.linalg.norm(shift[::3].mean(axis=0)) < 0.03  # no drift of the whole crown


def test_scans_are_shifted_by_the_same_distance_but_the_first():
    shots = some_shots()
    moved = world.misregistered(shots, 0.05, np.random.default_rng(1))
    distance = np.linalg.norm(moved.origin_m - shots.origin_m, axis=1)
    assert (distance[shots.scan == 1] == 0).all()
    assert distance[shots.scan == 2] == pytest.approx(0.05)
    assert np.array_equal(moved.range_m, shots.range_m)


def test_noise_has_its_share_and_stays_in_order():
    shots = some_shots()
    noisy = world.with_noise(shots, 0.2, ground_z_m=0.0, rng=np.random.default_rng(1))
    assert (noisy.truth == 7).mean() == pytest.approx(0.2, abs=0.01)
    assert len(noisy) == len(shots)
    rises = np.diff(noisy.range_m) >= 0
    same_shot = np.diff(noisy.shot_of_return) == 0
    assert rises[same_shot].all()
    true = noisy.truth == 4
    assert np.array_equal(noisy.range_m[true], shots.range_m)


def test_thinned_shots_keep_their_own_returns():
    shots = some_shots()
    chosen = np.random.default_rng(2).random(len(shots)) < 0.3
    few = shot_files.select(shots, chosen)
    assert len(few) == chosen.sum()
    assert np.array_equal(few.n_returns, shots.n_returns[chosen])
    expected = shots.return_xyz_m[chosen[shots.shot_of_return]]
    assert few.return_xyz_m == pytest.approx(expected)


def test_an_arc_of_positions_lies_on_one_side():
    circle = world.around(8, 360.0, 10.0, 1.6, seed=1)
    assert circle[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=1e-9)
    side = world.around(8, 90.0, 10.0, 1.6, seed=1)
    assert np.hypot(*side[:, :2].T) == pytest.approx(10.0)
    cosine = side[0, :2] @ side[-1, :2] / 100
    assert np.degrees(np.arccos(cosine)) == pytest.approx(90.0)


def test_sensors_are_wrong_by_the_distance_that_is_asked_for_and_level():
    places = world.sensors_m(SETUP, UNDISTURBED)
    wrong = sideways(places, 0.2, seed=1)
    assert np.linalg.norm(wrong - places, axis=1) == pytest.approx(0.2)
    assert np.array_equal(wrong[:, 2], places[:, 2])


def test_a_clock_that_is_ahead_sees_a_later_sun():
    right, ahead = (world.sky(SETUP, UNDISTURBED, minutes) for minutes in (0.0, 40.0))
    assert ahead["sun_azimuth_deg"][:-1].to_numpy() == pytest.approx(
        right["sun_azimuth_deg"][1:].to_numpy()
    )


@pytest.mark.parametrize("height_deg", [8.0, 30.0])
def test_a_low_sun_shines_through_the_crown_on_the_sensors(height_deg):
    conditions = Conditions(sun_elevation_deg=height_deg)
    when = world.times(SETUP, conditions)
    assert len(when) == len(world.times(SETUP, UNDISTURBED))
    sun = position(when, **{k: SETUP.site[k] for k in ("latitude_deg", "longitude_deg")})
    assert 90 - sun["sun_zenith_deg"].iloc[len(when) // 2] == pytest.approx(height_deg, abs=0.3)
    middle = world.sensors_m(SETUP, conditions).mean(axis=0)
    length = np.hypot(*middle[:2])
    assert length * np.tan(np.radians(height_deg)) == pytest.approx(1.1, rel=0.05)


def test_cloud_takes_the_beam_and_leaves_the_sky():
    for share in (0.1, 0.5, 1.0):
        sky = world.sky(SETUP, Conditions(diffuse_share=share))
        assert (sky["dhi_w_m2"] / sky["ghi_w_m2"]).to_numpy() == pytest.approx(share)
    beam = sky["beam_normal_umol_m2_s"].to_numpy()
    assert np.abs(beam).max() < 1e-6 * float(sky["diffuse_horizontal_umol_m2_s"].max())


def test_two_worlds_differ_and_one_world_is_always_the_same():
    first, again, other = (world.grow(SETUP, UNDISTURBED, seed)["leaf"] for seed in (1, 1, 2))
    assert np.array_equal(first.vertices_m, again.vertices_m)
    assert first.vertices_m.shape != other.vertices_m.shape or not np.allclose(
        first.vertices_m, other.vertices_m
    )


def test_a_second_tree_stands_where_it_should():
    alone, two = (
        world.grow(SETUP, replace(UNDISTURBED, second_tree_m=m), 1) for m in (np.inf, 3.0)
    )
    n = len(alone["wood"].vertices_m)
    foot = two["wood"].vertices_m[n:]
    foot = foot[foot[:, 2] < 0.05].mean(axis=0)
    assert np.hypot(*foot[:2]) == pytest.approx(3.0, abs=0.05)
