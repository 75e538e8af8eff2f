"""Plant area with intervals: what is not known of a voxel, a layer and a crown, and how much."""

import numpy as np
import pytest
import xarray as xr

from dapple.formats import meshes
from dapple.structure import plant_area
from dapple.structure.voxel_data import CAPPED, NOT_REACHED
from dapple.structure.voxel_sums import Grid
from dapple.structure.voxels import plant_area_density
from dapple.virtual import scanner

LEAF_M2 = 0.002


def voxels(density, error=0.0, *, scans=4, size=0.2, flag=0):
    density = np.asarray(density, float)
    data = {
        "plant_area_density_m2_m3": density,
        "standard_error_m2_m3": np.where(np.isnan(density), np.nan, error),
        "flag": np.full(density.shape, flag, np.uint8),
    }
    coords = {a: (np.arange(n) + 0.5) * size for a, n in zip("xyz", density.shape, strict=True)}
    attrs = {"voxel_size_m": size, "total_scans": scans}
    return xr.Dataset({k: (tuple("xyz"), v) for k, v in data.items()}, coords, attrs)


def found(grid):
    return plant_area.of_voxels(grid, element_area_m2=LEAF_M2, fill_range_m=0.5)


def test_an_interval_holds_its_area_and_grows_with_what_is_not_known():
    area, variance = np.full(3, 0.01), np.array([1e-8, 1e-6, 1e-5])
    low, high = plant_area.interval_m2(area, variance)
    assert (low < area).all()
    assert (area < high).all()
    assert (low >= 0).all()
    assert (np.diff(high - low) > 0).all()


def test_of_many_small_errors_the_interval_is_that_of_a_normal_distribution():
    low, high = plant_area.interval_m2(np.array(10.0), np.array(0.01))
    assert [low, high] == pytest.approx([10 - 0.196, 10 + 0.196], abs=0.003)


def test_where_no_beam_hit_a_leaf_there_may_be_none():
    low, high = plant_area.interval_m2(np.zeros(1), np.array([1e-6]))
    assert low[0] == 0.0
    assert high[0] > 1.96e-3


def test_larger_leaves_and_fewer_positions_leave_more_unknown():
    grid = voxels(np.ones((3, 3, 3)))
    small, large = (
        plant_area.of_voxels(grid, element_area_m2=own, fill_range_m=0.5).variance_m4.sum()
        for own in (LEAF_M2, 4 * LEAF_M2)
    )
    assert large == pytest.approx(4 * small)
    assert found(voxels(np.ones((3, 3, 3)), scans=1)).variance_m4.sum() > 2 * small


def test_an_unseen_voxel_takes_its_neighbours_area_is_marked_and_is_the_least_sure():
    density = np.ones((5, 5, 5))
    density[:, :, 3:] = 2.0
    density[2, 2, 2] = np.nan
    made = found(voxels(density, 0.05, flag=NOT_REACHED))
    assert made.is_filled.sum() == 1
    assert made.is_filled[2, 2, 2]
    assert 0.008 < made.area_m2[2, 2, 2] < 0.016
    known = made.variance_m4[~made.is_filled]
    assert made.variance_m4[2, 2, 2] > known.max()
    parts = plant_area.by_part(made)
    crown = parts[parts["part"] == "crown"].iloc[0]
    assert crown["filled_share"] == pytest.approx(made.area_m2[2, 2, 2] / made.area_m2.sum())


def test_air_far_from_leaves_is_sure_and_a_capped_voxel_may_hold_twice_as_much():
    density = np.zeros((7, 3, 3))
    density[0] = 5.0
    made = found(voxels(density, 0.5))
    assert (made.variance_m4[2:] == 0).all()
    capped = found(voxels(density, 0.5, flag=CAPPED))
    high_m2 = plant_area.interval_m2(capped.area_m2, capped.variance_m4)[1]
    assert (high_m2[0] > 2 * made.area_m2[0]).all()


def test_denser_voxels_hide_more_and_large_leaves_come_out_too_large_most_where_untold():
    thin, dense = (found(voxels(np.full((3, 3, 3), density))) for density in (1.0, 4.0))
    share = [(one.hidden_m2 / one.area_m2).mean() for one in (thin, dense)]
    assert share[1] - share[0] == pytest.approx(plant_area.HIDDEN * 3.0 * 0.2)
    assert (found(voxels(np.zeros((3, 3, 3)))).hidden_m2 == 0).all()
    grid = voxels(np.ones((3, 3, 3)), size=0.1)
    told = found(grid.assign_attrs(single_leaf_area_m2=LEAF_M2))
    assert (told.hidden_m2 > found(grid).hidden_m2).all()


def test_where_a_single_position_saw_nothing_more_is_hidden_than_where_four_did():
    density = np.ones((5, 5, 5))
    density[2, 2, 2] = np.nan
    one, four = (found(voxels(density, 0.05, scans=scans)) for scans in (1, 4))
    assert one.hidden_m2[2, 2, 2] == pytest.approx(4 * four.hidden_m2[2, 2, 2])


def test_layers_add_up_to_the_crown_whose_interval_is_narrower_than_theirs():
    made = found(voxels(np.random.default_rng(1).uniform(0.5, 1.5, (6, 6, 6)), 0.2))
    parts = plant_area.by_part(made)
    crown, layers = parts.iloc[0], parts[parts["part"] == "layer"]
    assert layers["plant_area_m2"].sum() == pytest.approx(crown["plant_area_m2"])
    width = (parts["high_m2"] - parts["low_m2"]) / parts["plant_area_m2"]
    assert (width[0] < width[1:]).all()


def test_bounds_of_voxels_are_files_that_say_their_units():
    grid = voxels(np.ones((2, 3, 4)), 0.1).assign_attrs(corner_m=np.zeros(3), origin_m=np.zeros(3))
    told = plant_area.as_dataset(found(grid), grid)
    assert told["plant_area_low_m2"].shape == (2, 3, 4)
    assert all({"units", "long_name"} <= set(told[name].attrs) for name in told)


def test_a_crown_of_discs_scanned_from_four_places_has_the_area_that_was_put_into_it():
    rng = np.random.default_rng(3)
    place = rng.uniform(-0.6, 0.6, (4000, 3)) + np.array([0, 0, 1.6])
    normal = rng.standard_normal((4000, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    leaves = meshes.of_discs(np.column_stack([np.full(4000, 0.012), place, normal]))
    fired = scanner.scan(
        {"leaf": leaves},
        scanner.positions_around(np.zeros(3), 4.0, 4),
        angular_step_deg=0.25,
        sub_rays=1,
        range_noise_m=0.0,
        noise_points_per_shot=0.0,
        seed=1,
    )
    bounds_m = np.array([leaves.vertices_m.min(axis=0), leaves.vertices_m.max(axis=0)])
    grid = plant_area_density(fired, Grid.around(bounds_m, 0.2), contact_voxel_m=0)
    assert grid.attrs["total_scans"] == 4
    crown = plant_area.by_part(
        plant_area.of_voxels(grid, element_area_m2=np.pi * 0.012**2, fill_range_m=0.5)
    ).iloc[0]
    assert crown["plant_area_m2"] == pytest.approx(leaves.area_m2, rel=0.03)
    assert crown["low_m2"] < leaves.area_m2 < crown["high_m2"]
