"""What estimators of plant area density make of media and leaves whose density is known."""

import numpy as np
import pytest
from tests.unit.test_voxels import TWO_SHOTS, column, in_column, shots_of, turbid

from dapple.errors import InputError
from dapple.structure import leaf_angles, voxel_sums
from dapple.structure.voxel_sums import Grid, accumulate
from dapple.structure.voxels import estimate, plant_area_density


@pytest.mark.parametrize("distribution", ["spherical", "planophile", "erectophile"])
def test_a_turbid_cube_has_the_density_it_was_made_of(distribution):
    from dapple.structure.leaf_angles import projection

    shots = turbid(0.6, lambda z: projection(distribution, z), 60_000, np.random.default_rng(1))
    grid = Grid(np.full(3, -2.0), (4, 4, 4), 1.0)
    result = plant_area_density(shots, grid, leaf_angle_distribution=distribution, min_shots=5)
    weight = result["path_length_m"].to_numpy()
    for name in ("transmittance", "ppl", "fpl"):
        density = result[f"pad_{name}_m2_m3"].to_numpy()
        assert np.average(density, weights=weight) == pytest.approx(0.6, rel=0.02), name


def leaves_by_chance(distribution, beam_zenith, n_leaves, area_m2, n_shots, rng):
    """Shots through a cubic metre in which a few round leaves lie anew for every shot.

    Leaves reach over the sides and come in at the others, so that every place is alike.
    """
    direction = np.array([np.sin(beam_zenith), 0.0, np.cos(beam_zenith)])
    shape = (n_shots, n_leaves)
    angle = (np.arange(2000) + 0.5) * np.pi / 4000
    cumulative = np.cumsum(leaf_angles.density(distribution, angle)) * np.pi / 4000
    tilt, turn = np.interp(rng.random(shape), cumulative, angle), 2 * np.pi * rng.random(shape)
    normal = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)
    centre, origin = rng.random((*shape, 3)), rng.random((n_shots, 3)) - 2 * direction
    with np.errstate(divide="ignore"):
        sides = (np.array([[0.0], [1.0]])[..., None] - origin) / direction
    enters, leaves = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
    first = np.full(n_shots, np.inf)
    for image in np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), -1).reshape(-1, 3):
        away = centre + image - origin[:, None]
        at = (away * normal).sum(axis=-1) / (normal @ direction)
        off = ((at[..., None] * direction - away) ** 2).sum(axis=-1)
        met = (off <= area_m2 / np.pi) & (at >= enters[:, None]) & (at < leaves[:, None])
        first = np.minimum(first, np.where(met, at, np.inf).min(axis=1))
    ranges = [[r] if np.isfinite(r) else [] for r in first]
    return shots_of(origin, direction, ranges)


def leaves_lie_wholly_in_a_voxel(monkeypatch):
    """No voxel cuts a leaf."""
    monkeypatch.setattr(voxel_sums, "part_of_leaf", lambda area_m2, size_m: area_m2)


@pytest.mark.parametrize(
    ("distribution", "beam_zenith_deg"), [("spherical", 30), ("planophile", 0), ("erectophile", 0)]
)
def test_few_large_leaves_have_their_density_with_their_own_area_alone(
    distribution, beam_zenith_deg, monkeypatch
):
    """Seven leaves of 0.3 m² in a cubic metre, G from 0.42 to 0.85; half or twice the area errs."""
    leaves_lie_wholly_in_a_voxel(monkeypatch)
    rng = np.random.default_rng(8)
    shots = leaves_by_chance(distribution, np.radians(beam_zenith_deg), 7, 0.3, 12_000, rng)

    def density(area_m2):
        options = {"leaf_angle_distribution": distribution, "single_leaf_area_m2": area_m2}
        dataset = plant_area_density(shots, column(1), contact_voxel_m=0.0, **options)
        return in_column(dataset, "pad_fpl_m2_m3")[0], in_column(dataset, "standard_error_m2_m3")[0]

    found, error = density(0.3)
    assert error < 0.02 * 2.1
    assert found == pytest.approx(2.1, abs=2 * error)
    assert density(0.15)[0] > 2.1 + 2 * error
    assert density(0.6)[0] < 2.1 - 2 * error


def test_half_of_amapvox_s_leaf_area_gives_amapvox_s_effective_path(monkeypatch):
    """It takes λ₁ = 0.25·area/V: given 0.4 m², 0.1 per metre."""
    leaves_lie_wholly_in_a_voxel(monkeypatch)
    result = plant_area_density(TWO_SHOTS, column(1), min_shots=1, single_leaf_area_m2=0.4 / 2)
    z = -np.log(1 - 0.1 * np.array([0.5, 1.0])) / 0.1
    expected = (1 / 3) / (z[0] / 3 + z[1] * 2 / 3 + z[1])
    assert 0.5 * in_column(result, "pad_fpl_biased_m2_m3")[0] == pytest.approx(expected)


@pytest.mark.parametrize("radius_m", [0.01, 0.1, 0.3])
def test_parts_of_leaves_are_those_into_which_voxels_cut_discs(radius_m):
    """Mean area of the parts in voxels of half a metre, each counted by its area."""
    rng = np.random.default_rng(1)
    normal, across = rng.standard_normal((2, 400, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.cross(normal, across)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    out, turn = radius_m * np.sqrt(rng.random((400, 400))), 2 * np.pi * rng.random((400, 400))
    plane = np.stack([across, np.cross(normal, across)], 1)
    inside = np.stack([out * np.cos(turn), out * np.sin(turn)], -1) @ plane
    cells = np.floor((inside + rng.random((400, 1, 3))) / 0.5).astype(int)
    flat = np.ravel_multi_index(tuple(np.moveaxis(cells + 4, -1, 0)), (12, 12, 12))
    of_area = np.mean([(np.bincount(one) ** 2).sum() / 400**2 for one in flat])
    area_m2 = np.pi * radius_m**2
    assert voxel_sums.part_of_leaf(area_m2, 0.5) == pytest.approx(area_m2 * of_area, rel=0.05)


def test_a_leaf_that_could_fill_a_voxel_is_refused():
    with pytest.raises(InputError, match=r"single_leaf_area_m2.*larger voxels"):
        plant_area_density(TWO_SHOTS, column(1), single_leaf_area_m2=1.2)


def test_the_largest_leaf_throws_a_shadow_of_the_volume_of_a_voxel_over_its_diagonal():
    voxel = Grid(np.zeros(3), (1, 1, 1), 0.5)
    largest = 0.5**3 / (0.5 * np.sqrt(3)) / 0.5  # half of its area is seen on average
    with pytest.raises(InputError, match=f"less than {largest:.2f} m²"):
        plant_area_density(TWO_SHOTS, voxel, single_leaf_area_m2=0.3)


def test_contact_frequency_counts_sub_voxels():
    shots = shots_of(
        np.array([[0.05, 0.05, -1], [0.05, 0.05, -1], [0.55, 0.55, -1]]),
        [0, 0, 1],
        [[1.05], [], []],
    )
    result = plant_area_density(shots, column(1), contact_voxel_m=0.1, min_shots=1)
    # 20 sub-voxels are visited, one holds a hit; cosθ/G is 2 for beams straight up.
    density = in_column(result, "pad_contact_frequency_m2_m3")[0]
    assert density == pytest.approx(2 / 0.1 * 1 / 20)


def test_contact_frequency_corrects_for_the_beams_angle():
    slanted = shots_of([0.5, 0.5, 0.001], [1, 0, np.sqrt(3)], [[0.3]] * 6 + [[]] * 6)
    sums = accumulate(slanted, column(1), contact_voxel_m=0.1)
    density = in_column(estimate(sums), "pad_contact_frequency_m2_m3")[0]
    expected = np.cos(np.radians(30)) / 0.5 / 0.1 * sums.n_hit_parts[0] / sums.n_touched_parts[0]
    assert sums.n_hit_parts[0] == 1
    assert density == pytest.approx(expected)


def test_a_sub_voxel_behind_the_last_echo_is_not_visited():
    shots = shots_of([0.05, 0.05, -1], [0, 0, 1], [[1.35]] * 9)
    sums = accumulate(shots, column(1), contact_voxel_m=0.1, allow_missing_misses=True)
    assert (sums.n_hit_parts[0], sums.n_touched_parts[0]) == (1, 4)


def disc_box(rng, side_m, n_discs, radius_m):
    """Isotropic discs wholly inside a box from 0 to `side_m`."""
    centre = radius_m + (side_m - 2 * radius_m) * rng.random((n_discs, 3))
    normal = rng.normal(size=(n_discs, 3))
    return centre, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def cast(origin, direction, centre, normal, radius_m):
    """Range of the first disc that each ray meets, infinite where none."""
    nearest = np.full(len(direction), np.inf)
    for c, n in zip(centre, normal, strict=True):
        along = direction @ n
        t = ((c - origin) @ n) / along
        off = origin + t[:, None] * direction - c
        met = (t > 0) & ((off**2).sum(axis=1) <= radius_m**2) & (t < nearest)
        nearest[met] = t[met]
    return nearest


def test_a_box_of_discs_has_the_density_of_its_leaves():
    rng = np.random.default_rng(12)
    centre, normal = disc_box(rng, 1.0, 800, 0.02)
    true_pad = 800 * np.pi * 0.02**2
    y, z = np.meshgrid(np.linspace(0.01, 0.99, 100), np.linspace(0.01, 0.99, 100))
    origin = np.array([-4.0, 0.5, 0.5])
    target = np.stack([np.full(y.size, 0.5), y.ravel(), z.ravel()], axis=1)
    direction = (target - origin) / np.linalg.norm(target - origin, axis=1, keepdims=True)
    ranges = cast(origin, direction, centre, normal, 0.02)
    shots = shots_of(origin, direction, [[r] if np.isfinite(r) else [] for r in ranges])
    for size in (0.25, 1.0):
        grid = Grid.around([[0, 0, 0], [1, 1, 1]], size)
        result = plant_area_density(shots, grid, contact_voxel_m=0.0)
        weight = result["n_shots"].to_numpy()
        for name in ("transmittance", "ppl", "fpl"):
            density = np.average(result[f"pad_{name}_m2_m3"], weights=weight)
            assert density == pytest.approx(true_pad, rel=0.05), (name, size)
