"""Effective density: an even medium that lets as much light through as the clumped one."""

import numpy as np
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.formats.shots import Shots
from dapple.structure import subvoxel_clumping
from dapple.structure.subvoxel_clumping import DENSITY, effective_density
from dapple.structure.voxel_sums import Grid
from dapple.structure.voxels import plant_area_density

U, G = 3.0, 0.5
DIMS = ("x", "y", "z")


def grid(density, size):
    """Voxels from a corner at 0."""
    density = np.asarray(density, float)
    coords = {a: (np.arange(n) + 0.5) * size for a, n in zip(DIMS, density.shape, strict=True)}
    data = {DENSITY: (DIMS, density), "flag": (DIMS, np.zeros(density.shape, np.uint8))}
    return xr.Dataset(data, coords, {"voxel_size_m": size, "leaf_angle_distribution": "spherical"})


def half_filled(n=10, size=1.0):
    """One voxel, its half on the west filled with density 2u; coarse and fine."""
    fine = np.zeros((n, n, n))
    fine[: n // 2] = 2 * U
    return grid(np.full((1, 1, 1), U), size), grid(fine, size / n)


def test_an_even_voxel_keeps_its_density():
    even = effective_density(grid(np.full((1, 1, 1), U), 1.0), grid(np.full((5, 5, 5), U), 0.2))
    assert even.item() == pytest.approx(U)


def test_a_half_filled_voxel_has_the_mean_transmittance_of_its_halves():
    coarse, fine = half_filled()
    across = -np.log(0.5 * (1 + np.exp(-G * 2 * U))) / G  # two of three axes see both halves
    assert effective_density(coarse, fine).item() == pytest.approx((U + 2 * across) / 3)
    assert across < U


def test_leaves_that_lie_flat_are_seen_less_from_the_side_than_from_above():
    """Planophile leaves in the lower half: only beams from the side see both halves apart."""
    coarse, fine = half_filled()
    lower = fine.rename(x="z", z="x").transpose(*DIMS)
    level = coarse.assign_attrs(leaf_angle_distribution="planophile")
    ahead = 8 / (3 * np.pi**2)  # projection of planophile leaves on a level beam; 8/(3π) from above
    across = -np.log(0.5 * (1 + np.exp(-ahead * 2 * U))) / ahead
    assert effective_density(level, lower).item() == pytest.approx((U + 2 * across) / 3, rel=1e-3)


def test_small_clumps_are_even_at_last():
    """The finer the clumps, the nearer the effective density comes to the mean."""
    found = []
    for size in (1.0, 0.1, 0.01):
        coarse, fine = half_filled(size=size)
        found.append(effective_density(coarse, fine).item())
    assert found == sorted(found)
    assert found[-1] == pytest.approx(U, rel=0.02)


def test_grids_that_begin_elsewhere_are_brought_together():
    coarse, fine = half_filled()
    shifted = fine.isel(x=slice(2, None))
    shifted_back = effective_density(coarse, shifted, min_known=0)
    fine[DENSITY][:2] = 0
    assert shifted_back == pytest.approx(effective_density(coarse, fine))


def test_facets_that_do_not_meet_are_refused():
    coarse, fine = half_filled()
    with pytest.raises(InputError, match="whole number"):
        effective_density(coarse, fine.assign_coords(x=fine.x + 0.03))
    with pytest.raises(InputError, match="whole number"):
        effective_density(coarse, grid(np.ones((3, 3, 3)), 0.3))


def test_where_few_fine_voxels_are_known_the_large_one_speaks():
    coarse, fine = half_filled()
    fine[DENSITY][3:] = np.nan
    assert effective_density(coarse, fine).item() == U


def beams(n_per_edge, stops_at):
    """Parallel beams along z through the unit cube; `stops_at(x, y, rng)` is where, or inf."""
    rng = np.random.default_rng(1)
    x, y = (np.indices((n_per_edge, n_per_edge)).reshape(2, -1) + 0.5) / n_per_edge
    origin = np.stack([x, y, np.full(x.shape, -1.0)], axis=1)
    end = stops_at(x, y, rng)
    stopped = end < 1
    n = len(x)
    return Shots(
        origin,
        np.tile([0.0, 0.0, 1.0], (n, 1)),
        np.zeros(n, np.uint16),
        np.concatenate([[0], np.cumsum(stopped)]),
        1.0 + end[stopped],
        np.zeros(stopped.sum(), np.float32),
        np.zeros(stopped.sum(), np.float32),
        np.zeros(3),
    )


def turbid_half(x, y, rng):
    """Beams on the west meet leaves of density 2u, those on the east nothing."""
    return np.where(x < 0.5, rng.exponential(1 / (G * 2 * U), x.shape), np.inf)


CUBE = Grid(np.zeros(3), (1, 1, 1), 1.0)


def test_beams_that_pass_a_half_filled_voxel_tell_its_transmittance():
    shots = beams(300, turbid_half)
    voxels = plant_area_density(shots, CUBE, contact_voxel_m=0)
    corrected = subvoxel_clumping.correct(voxels)
    expected = 0.5 * (1 + np.exp(-G * 2 * U))
    assert np.exp(-G * corrected[DENSITY].item()) == pytest.approx(expected, abs=0.005)
    # Free paths give another density: that of the leaves which beams met first.
    assert np.exp(-G * voxels[DENSITY].item()) < expected - 0.02


def test_the_clumping_index_finds_the_share_of_beams_that_get_through():
    shots = beams(300, turbid_half)
    believed = grid(np.full((1, 1, 1), U), 1.0)
    index = subvoxel_clumping.clumping_index(believed, shots)
    assert np.exp(-G * U * index) == pytest.approx(0.5 * (1 + np.exp(-G * 2 * U)), abs=0.01)
    assert index < 0.7


def test_the_clumping_index_of_a_turbid_medium_is_one_also_behind_wood():
    def turbid(x, y, rng):
        return rng.exponential(1 / (G * U), x.shape)

    shots = beams(300, turbid)
    believed = grid(np.full((1, 1, 1), U), 1.0)
    assert subvoxel_clumping.clumping_index(believed, shots) == pytest.approx(1, abs=0.02)
    # Wood at half the way stops each third beam that comes so far: no leaf, no hit.
    ends = np.minimum(turbid(np.zeros(90_000), None, np.random.default_rng(2)), 9.0)
    wood_m = np.where(np.arange(90_000) % 3 == 0, 0.5, np.inf)
    behind = beams(300, lambda *at: np.minimum(ends, wood_m))
    kinds = (behind.range_m == 1.5).astype(np.uint8)
    assert kinds.sum() > 10_000
    found = subvoxel_clumping.clumping_index(believed, behind, kinds=kinds)
    assert found == pytest.approx(1, abs=0.02)


def test_a_density_at_its_cap_lets_no_more_light_through_than_the_beams_say():
    shots = beams(200, lambda x, y, rng: rng.exponential(1 / (G * 12.0), x.shape))
    voxels = plant_area_density(shots, CUBE, contact_voxel_m=0, max_pad_m2_m3=5.0)
    assert voxels[DENSITY].item() == 5.0
    assert subvoxel_clumping.correct(voxels)[DENSITY].item() == pytest.approx(12.0, rel=0.1)


def test_unknown_voxels_inside_the_crown_are_filled_and_the_scan_says_how_much():
    cells = Grid(np.zeros(3), (5, 5, 5), 0.2)
    shots = beams(300, lambda x, y, rng: rng.exponential(1 / (G * U), x.shape))
    voxels = plant_area_density(shots, cells, contact_voxel_m=0)
    centre = (slice(1, 4),) * 3
    for name in (DENSITY, "pad_transmittance_m2_m3"):
        voxels[name][centre] = np.nan
    corrected = subvoxel_clumping.correct(voxels, None, shots)
    assert corrected[DENSITY].values[centre] == pytest.approx(U, rel=0.3)
    assert corrected[DENSITY].mean().item() == pytest.approx(U, rel=0.1)
    assert corrected.attrs["leaf_area_before_m2"] < 0.85 * U
    kept = subvoxel_clumping.correct(voxels, None, fill_range_m=None)
    assert np.isnan(kept[DENSITY].values[centre]).all()


def test_the_dataset_given_stays_as_it_was():
    coarse, fine = half_filled()
    before = coarse[DENSITY].values.copy(), fine[DENSITY].values.copy()
    subvoxel_clumping.correct(coarse, fine)
    np.testing.assert_array_equal(coarse[DENSITY], before[0])
    np.testing.assert_array_equal(fine[DENSITY], before[1])
