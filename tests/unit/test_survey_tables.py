"""Tables of scan surveys: factors of coverage are found, and what no beam reached is counted."""

import numpy as np
import pytest
from tests.unit.test_survey import made_up

from dapple.errors import InputError
from dapple.formats.shots import Shots
from dapple.survey import compare, correction, coverage, grid_files, shadow
from dapple.survey.voxel_status import HIT, PASSED, UNSEEN

APPLE, PINE = (1.25, 1.5, 2, 3, 4, 8), (2.5, 3, 4, 6, 8, 16)
RUNS = {
    (stand, seed, "corners"): made_up(seed, factor)
    for stand, factor in (("apple", APPLE), ("pine", PINE))
    for seed in (1, 2)
}


def test_factors_by_coverage_are_those_that_made_the_cells():
    table = compare.factor_table(RUNS).set_index(["stand", "coverage_class"])["factor_share"]
    for stand, factors in (("apple", APPLE), ("pine", PINE)):
        assert table[stand][list(correction.CLASSES)].to_numpy() == pytest.approx(factors)
    slopes = compare.regression_table(RUNS).set_index("stand")["slope"]
    assert slopes["apple"].to_numpy() == pytest.approx(1 / np.array(APPLE))


def test_trees_of_the_same_species_correct_each_other_and_those_of_another_do_not():
    table = compare.correction_table(RUNS).set_index("factors_from")
    same = table.loc[["own even cells", "other trees"]]
    assert (same["ratio"] < 1e-9).all()
    assert (same["rmse_measured"] > 0.3).all()
    # Factors of pine are just twice those of apple: all of it is found again, or half.
    other = table.loc["other stand"].query("quantity == 'share'").set_index("stand")
    assert other.loc["apple", "rmse_corrected"].to_numpy() == pytest.approx(1.0, rel=0.05)
    assert other.loc["pine", "rmse_corrected"].to_numpy() == pytest.approx(0.5, rel=0.05)


def test_a_profile_is_corrected_by_the_other_trees():
    table = compare.profile_table(RUNS, cell_size_m=0.5)
    assert table["corrected_share"].to_numpy() == pytest.approx(table["true_share"].to_numpy())
    assert table["corrected"].to_numpy() == pytest.approx(table["true"].to_numpy())
    first = table[(table["stand"] == "apple") & (table["seed"] == 1)]
    assert first["height_m"].tolist() == [0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75]


def test_columns_of_a_map_and_layers_of_a_profile_count_the_same_voxels():
    """A filled voxel that was hit, one that beams passed, one that none reached; an empty one."""
    status = np.array([HIT, PASSED, UNSEEN, PASSED], np.uint8).reshape(2, 2, 1)
    filled = np.array([True, True, True, False]).reshape(2, 2, 1)
    profile = shadow.filled_profile(status, filled)
    assert {name: values.tolist() for name, values in profile.items()} == {
        "true": [3], "hit": [1], "reached": [2],
    }  # fmt: skip
    assert shadow.shadow_map(status, filled, 2, 0, 1) == pytest.approx(2 / 3)
    single = shadow.shadow_map(status, filled, 1, 0, 1)
    assert single[:2, 0].tolist() == [0.0, 1.0]
    assert np.isnan(single[1, 1])
    with pytest.raises(InputError, match="one divides the other"):
        shadow.in_cells(filled, 2)


def from_above(corners=((0, 0), (1, 0), (0, 1), (1, 1))):
    """Shots straight down, ten by ten on each square metre, that end in the lowest decimetre.

    One more square metre, far away, has shots that met nothing.
    """
    at = np.stack(np.meshgrid(*[np.arange(10) * 0.1 + 0.05] * 2), axis=-1).reshape(-1, 2)
    met = np.concatenate([at[:0], *(at + corner for corner in corners)])
    places = np.concatenate([met, at + 9.0])
    n, m = len(places), len(met)
    return Shots(
        np.column_stack([places, np.full(n, 3.0)]),
        np.tile([0.0, 0.0, -1.0], (n, 1)),
        np.ones(n, np.uint16),
        np.minimum(np.arange(n + 1), m),
        np.full(m, 2.95),
        np.full(m, -8.0, np.float32),
        np.zeros(m, np.float32),
        np.zeros(3),
    )


def test_where_every_voxel_was_reached_a_tenth_of_them_was_hit():
    classes, summary = coverage.of_shots(lambda: [from_above()])
    assert [(row["coverage_class"], row["cells"]) for row in classes] == [("full", 4)]
    assert classes[0]["mean_contact_frequency"] == pytest.approx(0.1)
    assert summary["share_of_voxels_reached"] == 1.0
    assert summary["share_of_canopy_in_unseen_voxels"] == pytest.approx(0.0)


def test_a_cell_that_no_beam_reached_is_filled_as_its_neighbours_are():
    classes, summary = coverage.of_shots(lambda: [from_above(((0, 0), (1, 0), (0, 1), (2, 1)))])
    by_class = {row["coverage_class"]: row for row in classes}
    assert by_class["never"]["cells"] == 2
    assert summary["share_of_cells_never_reached"] == pytest.approx(2 / 6)
    assert by_class["never"]["mean_density_m2_m3"] == pytest.approx(
        by_class["full"]["mean_density_m2_m3"], rel=1e-3
    )
    assert summary["share_of_canopy_filled"] == pytest.approx(2 / 6, rel=1e-3)


def test_a_scan_without_returns_or_of_too_many_voxels_says_what_to_do():
    with pytest.raises(InputError, match="met something"):
        coverage.of_shots(lambda: [from_above(())])
    with pytest.raises(InputError, match="larger voxels or cut the scan"):
        coverage.of_shots(lambda: [from_above()], voxel_size_m=0.001)


def test_grids_of_the_same_numbers_are_the_same_bytes(tmp_path):
    values = {"area_m2": np.random.default_rng(1).random((3, 4, 5)), "status": np.eye(3)[None] > 0}
    values["status"] = np.broadcast_to(values["area_m2"] > 0.5, (3, 4, 5)).astype(np.uint8)
    for name in ("a.nc", "b.nc"):
        grid_files.write(tmp_path / name, values, voxel_size_m=0.1)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
