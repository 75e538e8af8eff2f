"""Hemispherical scans, what they reach, shadow, and correction by coverage."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.survey import correction, designs, fill, hemisphere, plan, shadow
from dapple.survey.hemisphere import Beams, returns
from dapple.survey.hemisphere_scanner import Hemisphere
from dapple.survey.voxel_status import HIT, PASSED, UNSEEN, Reach, attribute
from dapple.virtual import stands
from dapple.virtual.box_grids import voxels_per_cell


def follow(origin, direction, range_m=(np.inf,), shape=(4, 4, 4), **options):
    direction = np.asarray(direction, float) / np.linalg.norm(direction)
    reach = Reach.empty(shape, 1.0, **options)
    one = np.ones(1, np.uint16)
    reach.add(Beams(np.asarray(origin, float), direction[None], np.array([range_m], float), one))
    return attribute(*reach.joined(), 0)


def test_a_beam_along_an_axis_passes_all_voxels_but_the_scanners_own():
    found = follow([0.5, 1.5, 2.5], [1, 0, 0])
    assert found[1:, 1, 2].tolist() == [PASSED] * 3
    assert (found == UNSEEN).sum() == 64 - 3


def test_a_beam_passes_up_to_its_return():
    found = follow([0.5, 1.5, 2.5], [1, 0, 0], [1.7])
    assert found[:, 1, 2].tolist() == [UNSEEN, PASSED, HIT, UNSEEN]


def test_only_opposite_faces_count_as_passing():
    # climbs one layer in every voxel: enters voxels from the side and leaves by the top
    found = follow([0.0, 0.5, 0.6], [1, 0, 0.9])
    assert found[0, 0, 0] == UNSEEN
    assert follow([0.0, 0.5, 0.6], [1, 0, 0.9], any_face=True)[0, 0, 0] == PASSED


def test_beams_from_outside_come_in_through_a_face():
    assert follow([-3.0, 1.5, 1.5], [1, 0, 0])[:, 1, 1].tolist() == [PASSED] * 4


def test_a_return_needs_a_tenth_of_the_energy_within_a_pulse():
    hits = np.array([[1.0, 5.0, 5.2, np.inf], [1.0, 2.0, 3.0, np.inf]], np.float32)
    # one sub-ray in four at reflectance 0.3 is 0.075 of the beam: two are needed
    assert returns(hits, 0.075, 0.1, 0.5, 1)[:, 0] == pytest.approx([5.2, np.inf])
    assert returns(hits, 0.1, 0.1, 0.5, 1)[:, 0] == pytest.approx([1.0, 1.0])


def test_targets_within_a_pulse_are_one_return_and_farther_ones_the_next():
    hits = np.array([[1.0, 5.0, 5.2, 7.0, np.inf]], np.float32)
    assert returns(hits, 0.1, 0.1, 0.5, 4)[0] == pytest.approx([1.0, 5.0, 7.0, np.inf])
    assert returns(hits, 0.1, 0.1, 0.5, 2)[0] == pytest.approx([1.0, 5.0])


def test_a_beam_with_several_returns_goes_on_to_the_last():
    found = follow([0.5, 1.5, 2.5], [1, 0, 0], [1.2, 2.7])
    assert found[:, 1, 2].tolist() == [UNSEEN, HIT, PASSED, HIT]
    far = follow([-3.0, 1.5, 1.5], [1, 0, 0], [1.0, 5.5])
    assert far[:, 1, 1].tolist() == [PASSED, PASSED, HIT, UNSEEN]


def test_designs_share_the_beams_as_published():
    scanner = Hemisphere()
    millions = [0.26, 0.65, 1.30, 3.24, 6.48]
    for n_positions in (1, 5):
        assert np.divide(scanner.n_beams(n_positions), 1e6) == pytest.approx(millions, abs=0.005)


@pytest.mark.parametrize("steps", [(), (0.5, 0.3), (400.0,)])
def test_steps_that_make_no_scan_are_refused(steps):
    with pytest.raises(InputError, match="azimuth_steps_deg"):
        Hemisphere(azimuth_steps_deg=steps)


@pytest.fixture(scope="module")
def scene():
    stand = stands.grow(
        "fagus",
        [(2.0, 2.0)],
        size_m=(4.0, 4.0, 5.0),
        leaf_area_index=0.5,
        seed=1,
        height_m=4.0,
        crown_base_m=1.2,
        crown_radius_m=1.0,
        dbh_m=0.2,
        n_clumps=20,
        twigs_per_leaf_m2=10.0,
    )
    return stand, hemisphere.world_of(stand)


def scanned(scene, steps=(4.0, 2.0)):
    stand, world = scene
    scanner = Hemisphere(zenith_step_deg=2.0, azimuth_steps_deg=steps)
    place = np.array([0.5, 0.5, 0.8])
    return list(hemisphere.scan(world, stand, place, scanner, 1, seed=5)), scanner


def test_returns_lie_where_something_grows(scene):
    beams, _ = scanned(scene)
    filled = sum(stands.area_in_voxels(scene[0], part, 0.1) for part in ("leaves", "wood")) > 0
    reach = Reach.empty((40, 40, 50), 0.1)
    for some in beams:
        reach.add(some)
    hit = attribute(*reach.joined(), 1) == HIT
    assert hit.sum() > 50
    assert filled[hit].mean() > 0.9


def test_coarse_scans_are_part_of_fine_ones(scene):
    beams, scanner = scanned(scene)
    per_bit = [sum((b.bits >> bit & 1).sum() for b in beams) for bit in range(2)]
    assert per_bit == scanner.n_beams(1)


@pytest.mark.parametrize(("place", "found"), [((2.0, 2.0, 0.5), "trunk"), ((9, 0, 1), "9, 0, 1")])
def test_scanners_stand_in_the_open(scene, place, found):
    with pytest.raises(InputError, match=found):
        hemisphere.check_position(scene[1], scene[0], np.array(place, float))


def test_relative_shadow_is_what_sent_no_return_passed_or_not():
    found = np.array([HIT, PASSED, UNSEEN, UNSEEN, HIT]).reshape(5, 1, 1)
    filled = np.array([1, 1, 1, 1, 0], bool).reshape(5, 1, 1)
    shares = shadow.relative_shadow(found, filled)
    assert shares == {"rs": 0.75, "unreached": 0.5, "false_hits": 0.5}


def test_an_empty_stand_has_no_shadow():
    nothing = np.zeros((2, 2, 2), bool)
    with pytest.raises(InputError, match="no filled voxel"):
        shadow.relative_shadow(nothing + UNSEEN, nothing)


@pytest.mark.parametrize("sizes", [(1.0, 0.3), (0.1, 0.2)])
def test_cells_are_made_of_whole_voxels(sizes):
    with pytest.raises(InputError, match="cell_size_m"):
        voxels_per_cell(*sizes)


def test_coverage_classes_have_the_published_edges():
    classes = correction.coverage_classes(np.array([1.0, 0.999, 0.81, 0.8, 0.21, 0.2, 0.01, 0.0]))
    assert classes.tolist() == [0, 1, 1, 2, 4, 5, 5, correction.NEVER]


def made_up(seed, factor=(1.25, 1.5, 2, 3, 4, 8)):
    """Cells whose contact frequency is too low by a factor that depends on coverage alone."""
    rng = np.random.default_rng(seed)
    number = rng.integers(0, 6, (8, 8, 8))
    truth = rng.uniform(0, 0.1, (8, 8, 8))
    contact = truth / np.array(factor)[number]
    return correction.Cells(contact, number, contact * 10, truth, truth * 10, 0.1)


def test_factors_undo_what_coverage_did_on_other_cells():
    factors = correction.fit_factors([made_up(1)], "share")
    other = made_up(2)
    corrected = correction.apply_factors(other, factors, "share")
    assert corrected == pytest.approx(other.true_share)


def test_factors_are_fitted_on_even_cells_alone():
    cells = made_up(3)
    before = correction.fit_factors([cells], "share")
    cells.contact[~cells.even] *= 7
    assert np.array_equal(correction.fit_factors([cells], "share"), before)


def test_regression_finds_the_slope_of_a_class():
    rows = correction.regressions([made_up(4)])
    assert [row["slope"] for row in rows] == pytest.approx([0.8, 2 / 3, 0.5, 1 / 3, 0.25, 0.125])
    assert [row["r2"] for row in rows] == pytest.approx([1.0] * 6)


def test_kriging_keeps_what_is_known_and_marks_what_is_not():
    values = np.random.default_rng(1).uniform(1, 2, (5, 5, 5))
    values[2, 2, 2] = np.nan
    filled, error, is_filled = fill.krige(values, np.zeros_like(values), cell_size_m=1.0)
    assert is_filled.sum() == 1
    assert np.array_equal(filled[~is_filled], values[~is_filled])
    assert 1 < filled[2, 2, 2] < 2
    assert error[2, 2, 2] > 0


def test_uncertain_donors_weigh_less():
    values = np.array([0.0, np.nan, 1.0, 0.0, 1.0]).reshape(5, 1, 1)
    sure, unsure = np.full(values.shape, 0.05), np.full(values.shape, 0.05)
    unsure[0] = 2.0
    fills = [fill.krige(values, e, cell_size_m=1.0)[0][1, 0, 0] for e in (sure, unsure)]
    assert fills[1] > fills[0]


def test_a_flat_field_is_filled_flat():
    values = np.full((4, 4, 4), 0.7)
    values[1:3, 1:3, 1:3] = np.nan
    assert fill.krige(values, np.zeros_like(values), cell_size_m=1.0)[0] == pytest.approx(0.7)


SCAN = {"cell_size_m": 1.0, "voxel_size_m": 0.1, "zenith_step_deg": 0.25, "azimuth_step_deg": 0.25}


def test_foliage_hides_what_is_behind_it_as_beer_says():
    density = np.zeros((9, 1, 1))
    density[3:5] = 0.8
    place = np.array([[0.0, 0.5, 0.4]])
    options = {"views": 1.0, "shown": 1.0, "step_m": 0.01}
    chance = plan.chance_of_return(density, place, **options, **SCAN)[0, :, 0, 0]
    assert chance[:3] == pytest.approx(1.0)
    assert chance[5:] == pytest.approx(np.exp(-0.5 * 0.8 * 2), rel=0.02)


def test_a_beam_through_a_voxel_may_miss_what_is_in_it():
    """Beams as many as fall on a voxel of 10 cm at 1.5 m, each with a chance of a tenth."""
    place = np.array([[0.5, 0.5, 0.4]])
    chance = plan.chance_of_return(np.zeros((3, 1, 1)), place, shown=0.1, **SCAN)[0, :, 0, 0]
    away = np.array([1.0, 2.0])
    distance = np.hypot(away, 0.1)
    step = np.radians([SCAN["zenith_step_deg"], SCAN["azimuth_step_deg"]])
    beams = (SCAN["voxel_size_m"] / distance) ** 2 / (step.prod() * away / distance)
    assert beams.min() > 3
    assert chance[1:] == pytest.approx(1 - 0.9**beams, rel=1e-6)


def test_the_planner_takes_the_side_that_the_first_scan_cannot_see():
    density = np.zeros((9, 3, 3))
    density[4] = 5.0
    places = np.array([[0.5, 1.5, 0.1], [1.5, 1.5, 0.1], [8.5, 1.5, 0.1]])
    chance = plan.chance_of_return(density, places, **SCAN)
    order, expected = plan.choose(chance, np.ones_like(density), 2, taken=(0,))
    assert order == [0, 2]
    assert expected[1] < expected[0]


def test_more_scans_than_candidates_are_refused():
    with pytest.raises(InputError, match="plan_scans"):
        plan.choose(np.ones((2, 1, 1, 1)), np.ones((1, 1, 1)), 3)


def test_orders_start_in_the_centre_and_hold_the_designs():
    places_m = np.array(designs.candidates((4.0, 4.0, 8.0), 1.3, 3))
    chance = np.full((9, 4, 4, 8), 0.5)
    orders, expected = plan.orders(
        chance, np.ones((4, 4, 8)), places_m, (4.0, 4.0, 8.0), 5, 2, seed=1
    )
    assert {name: len(several) for name, several in orders.items()} == {
        "planner": 1, "diamond": 1, "corners": 1, "random": 2
    }  # fmt: skip
    assert all(order[0] == 4 for several in orders.values() for order in several)
    assert sorted(map(tuple, places_m[orders["corners"][0][1:], :2])) == [
        (0, 0), (0, 4), (4, 0), (4, 4)
    ]  # fmt: skip
    assert expected == pytest.approx([0.5**k for k in range(1, 6)])


def test_new_places_are_free_and_apart_from_the_scans():
    density = np.zeros((4, 4, 2))
    density[0, 0] = 5.0
    found = plan.places(density, 1.0, np.array([[4.0, 4.0, 1.5]]), 3, 1.3)
    assert found[0].tolist() == [4.0, 4.0, 1.5]
    assert len(found) == 1 + 9 - 2
    assert (found[:, 2] == 1.5).all()


def test_measured_shadow_adds_up_scans():
    hit = np.array([0b00, 0b01, 0b10, 0b11], np.uint32)
    assert plan.measured_rs(hit, [1, 0]) == [0.5, 0.25]


def test_designs_have_the_centre_first_and_unknown_ones_are_refused():
    for design in ("single", "diamond", "corners"):
        assert designs.positions(design, (15, 15, 30), 1.3)[0] == (7.5, 7.5, 1.3)
    with pytest.raises(InputError, match="star"):
        designs.positions("star", (15, 15, 30), 1.3)
    with pytest.raises(InputError, match="no position"):
        designs.positions("list", (15, 15, 30), 1.3)
