"""Estimators give the density of media whose density is known, and their equations hold."""

import numpy as np
import pytest
from scipy.optimize import brentq

from dapple.errors import InputError
from dapple.structure import estimators, leaf_angles

BEAM_ZENITH = np.radians([0.0, 20.0, 57.3, 75.0, 90.0])


@pytest.mark.parametrize("distribution", leaf_angles.DISTRIBUTIONS)
def test_leaf_angles_are_a_distribution(distribution):
    angle = (np.arange(2000) + 0.5) * np.pi / 4000
    total = leaf_angles.density(distribution, angle).sum() * np.pi / 4000
    assert total == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("distribution", leaf_angles.DISTRIBUTIONS)
def test_leaves_show_half_their_area_on_the_mean_of_all_directions(distribution):
    height = (np.arange(4000) + 0.5) / 4000
    seen = leaf_angles.projection(distribution, np.arccos(height))
    assert seen.mean() == pytest.approx(0.5, abs=1e-5)


@pytest.mark.parametrize(
    ("distribution", "seen_from_above"),
    [
        ("spherical", 1 / 2),
        ("planophile", 8 / (3 * np.pi)),
        ("erectophile", 4 / (3 * np.pi)),
        ("plagiophile", 32 / (15 * np.pi)),
        ("extremophile", 28 / (15 * np.pi)),
        ("uniform", 2 / np.pi),
    ],
)
def test_the_projection_from_above_is_the_closed_form(distribution, seen_from_above):
    assert leaf_angles.projection(distribution, 0.0) == pytest.approx(seen_from_above, abs=1e-7)


def test_the_projection_is_that_of_leaves_thrown_by_chance():
    rng = np.random.default_rng(2)
    n = 400_000
    zenith = np.arccos(1 - 2 * rng.random(n)) / 2  # density sin(2θ): not one of those tabulated
    weight = leaf_angles.density("planophile", zenith) / np.sin(2 * zenith)
    azimuth = 2 * np.pi * rng.random(n)
    for beam in BEAM_ZENITH:
        cosine = np.cos(beam) * np.cos(zenith) + np.sin(beam) * np.sin(zenith) * np.cos(azimuth)
        seen = weight * np.abs(cosine)
        error = seen.std() / np.sqrt(n)
        assert abs(leaf_angles.projection("planophile", beam) - seen.mean()) < 4 * error


def test_a_beam_from_below_sees_what_a_beam_from_above_sees():
    above = leaf_angles.projection("erectophile", BEAM_ZENITH)
    assert leaf_angles.projection("erectophile", np.pi - BEAM_ZENITH) == pytest.approx(above)


def test_an_unknown_leaf_angle_distribution_is_refused():
    with pytest.raises(InputError, match="planophile"):
        leaf_angles.projection("planophil", 0.3)


def moments_of(u, weight, u_max, count):
    t = 2 * u / u_max - 1
    return np.array([[np.sum(weight * t**j) for j in range(count)]])


@pytest.fixture
def paths():
    """Paths of 400 beam shares through a voxel; some hit, with very different weights."""
    rng = np.random.default_rng(8)
    u_max = 0.5 * np.sqrt(3)
    u = u_max * rng.random(400) ** 1.5
    weight = rng.choice([1.0, 0.5, 1 / 3], 400)
    return u, weight, rng.random(400) < 1 - np.exp(-1.7 * u), u_max


def test_moments_solve_the_same_equations_as_all_paths(paths):
    u, weight, is_hit, u_max = paths
    count = estimators.n_moments(5.0 * u_max)
    every = np.sum(weight)
    hits = np.sum(weight[is_hit])
    nodes, w = estimators.path_nodes(moments_of(u, weight, u_max, count), u_max)
    found = estimators.transmittance(nodes, w, np.array([hits]), np.array([every]), 5.0)
    exact = brentq(lambda k: np.sum(weight * np.exp(-k * u)) - every + hits, 0, 5, xtol=1e-14)
    assert found[0] == pytest.approx(exact, rel=1e-8)

    nodes, w = estimators.path_nodes(moments_of(u[is_hit], weight[is_hit], u_max, count), u_max)
    passing = np.sum((weight * u)[~is_hit])
    found = estimators.potential_path(nodes, w, np.array([hits]), np.array([passing]), 5.0)
    exact = brentq(
        lambda k: np.sum((weight * u / np.expm1(k * u))[is_hit]) - passing, 1e-6, 5, xtol=1e-14
    )
    assert found[0] == pytest.approx(exact, rel=1e-8)
    assert found[0] == pytest.approx(1.7, abs=0.4)


def test_unequal_paths_are_not_taken_for_their_mean(paths):
    """Beer-Lambert with the mean path is off by more than the solution's tolerance."""
    u, weight, is_hit, u_max = paths
    every, hits = np.sum(weight), np.sum(weight[is_hit])
    naive = -np.log(1 - hits / every) / np.average(u, weights=weight)
    nodes, w = estimators.path_nodes(moments_of(u, weight, u_max, 16), u_max)
    found = estimators.transmittance(nodes, w, np.array([hits]), np.array([every]), 5.0)
    assert abs(naive / found[0] - 1) > 0.02


def test_where_nothing_passes_density_is_the_cap_and_where_nothing_is_hit_zero():
    nodes = np.array([0.1, 0.4])
    weight = np.array([[1.0, 2.0], [1.0, 2.0]])
    hits, every = np.array([3.0, 0.0]), np.array([3.0, 3.0])
    pad = estimators.transmittance(nodes, weight, hits, every, 5.0)
    assert pad.tolist() == [5.0, 0.0]
    pad = estimators.potential_path(nodes, weight, hits, np.array([0.0, 0.7]), 5.0)
    assert pad.tolist() == [5.0, 0.0]


@pytest.mark.parametrize("depth", [0.01, 0.87, 4.3, 8.7, 29.0])
def test_the_number_of_moments_is_enough_for_the_depth(depth):
    count = estimators.n_moments(depth)
    u = np.linspace(0, depth, 57)
    for path in u:
        nodes, w = estimators.path_nodes(moments_of(path, 1.0, depth, count), depth)
        assert w[0] @ np.exp(-nodes) == pytest.approx(np.exp(-path), abs=1e-8)


def test_a_cap_that_no_beam_could_tell_is_refused():
    with pytest.raises(InputError, match="smaller voxels"):
        estimators.n_moments(100.0)


def draw_voxels(pad, n_shots, n_voxels, rng):
    """Free paths of shots through voxels with chords of 0.2 to 1 m and G = 0.5."""
    potential = 0.2 + 0.8 * rng.random((n_voxels, n_shots))
    free = rng.exponential(1 / (0.5 * pad), potential.shape)
    is_hit = free < potential
    u = 0.5 * np.minimum(free, potential)
    hits, hit_free = is_hit.sum(axis=1), (u * is_hit).sum(axis=1)
    n = np.full(n_voxels, float(n_shots))
    return hits.astype(float), hit_free, u.sum(axis=1), n, n


def test_the_corrected_estimator_is_unbiased_with_ten_shots_and_the_other_is_not():
    corrected, biased, _ = estimators.free_path(
        *draw_voxels(1.5, 10, 60_000, np.random.default_rng(4))
    )
    error = corrected.std() / np.sqrt(len(corrected))
    assert corrected.mean() == pytest.approx(1.5, abs=4 * error + 0.01 * 1.5)
    assert biased.mean() > 1.5 * 1.05


def test_the_standard_error_is_the_scatter_between_voxels():
    corrected, _, error = estimators.free_path(
        *draw_voxels(1.5, 200, 20_000, np.random.default_rng(5))
    )
    assert error.mean() == pytest.approx(corrected.std(), rel=0.03)


def test_without_a_hit_the_standard_error_is_that_of_one():
    one = np.array([1.0])
    corrected, _, error = estimators.free_path(0 * one, 0 * one, 10 * one, 40 * one, 40 * one)
    assert corrected[0] == 0
    assert error[0] == pytest.approx(1 / 10)


def test_contact_frequency_is_the_share_of_sub_voxels_met():
    pad = estimators.contact_frequency(
        np.array([3, 0, 0]), np.array([30, 30, 0]), np.array([1.07, 1.07, np.nan]), 0.05
    )
    assert pad == pytest.approx([1.07 / 0.05 * 0.1, 0, 0])
