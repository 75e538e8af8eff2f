"""Plots: cover, distances, copies of trees, terrain, chlorophyll and ground are as asked."""

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.optics.bands import camera_mean
from dapple.optics.cameras import ZHAO
from dapple.virtual import plot_optics, plots, terrain
from dapple.virtual.crown_outlines import area_m2, outline

SIZE_M = (30.0, 20.0)
ANGLE = np.arange(24) * 2 * np.pi / 24
DISC = 2.0 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
SIZES = plots.Sizes(12.0, 1.0, 2.0, 0.3)
GROUND = terrain.undulating(seed=4)
TRIANGLE = Mesh(
    np.array([[0.0, 0, 1], [1, 0, 1.5], [0, 1, 2]]), np.array([[0, 1, 2]], np.int32),
    np.zeros(1, np.int32),
)  # fmt: skip


def planted(seed=1, **changes):
    settings = {"size_m": SIZE_M, "margin_m": 5.0, "cover_share": 0.6} | changes
    return plots.plant([DISC, 0.8 * DISC], np.array([12.0, 11.0]), SIZES, GROUND, seed=seed,
                       **settings)  # fmt: skip


def test_the_outline_of_a_disc_is_the_disc():
    rng = np.random.default_rng(1)
    angle, share = rng.uniform(0, 2 * np.pi, 60_000), np.sqrt(rng.uniform(0, 1, 60_000))
    points = np.column_stack([3 * share * np.cos(angle), 3 * share * np.sin(angle), share])
    assert area_m2(outline(points)) == pytest.approx(np.pi * 9, rel=0.04)


def test_cover_counts_overlapping_crowns_once():
    crowns = [DISC + 10.0, DISC + 10.0, DISC]
    of_disc = area_m2(DISC)
    assert plots.cover(crowns, SIZE_M) == pytest.approx(1.25 * of_disc / 600, rel=0.01)


@pytest.mark.parametrize("share", [0.3, 0.62])
def test_the_cover_is_met(share):
    trees = planted(cover_share=share)
    crowns = plots.rings(trees, [DISC, 0.8 * DISC])
    assert plots.cover(crowns, SIZE_M) == pytest.approx(share, abs=0.002)


def test_stems_keep_their_distance():
    trees = planted()
    xy, radius = trees[["x_m", "y_m"]].to_numpy(), trees.crown_radius_m.to_numpy()
    distance = np.hypot(*(xy[:, None] - xy).T)
    least = 0.7 * (radius[:, None] + radius)
    np.fill_diagonal(distance, np.inf)
    assert (distance >= least).all()


def test_trees_stand_on_the_ground_in_plot_and_margin():
    trees = planted()
    np.testing.assert_allclose(trees.z_m, GROUND.height_m(trees[["x_m", "y_m"]]))
    assert trees.x_m.min() < 0 < SIZE_M[0] < trees.x_m.max()
    assert trees.x_m.between(-5, 35).all()


def test_crowns_are_as_wide_as_the_table_says():
    trees = planted()
    for tree, ring in zip(trees.itertuples(), plots.rings(trees, [DISC, 0.8 * DISC]), strict=True):
        assert area_m2(ring) == pytest.approx(tree.crown_area_m2)


def test_the_seed_makes_the_plot():
    pd.testing.assert_frame_equal(planted(seed=5), planted(seed=5))
    assert not planted(seed=5).x_m.equals(planted(seed=6).x_m)


def test_cover_that_has_no_room_is_refused():
    with pytest.raises(InputError, match="no room"):
        planted(cover_share=0.94, core_share=1.0)


def test_copies_are_stretched_turned_and_moved():
    trees = pd.DataFrame(
        {"grown": [0], "turn_deg": [90.0], "stretch_across": [2.0], "stretch_up": [3.0],
         "x_m": [10.0], "y_m": [20.0], "z_m": [5.0]}
    )  # fmt: skip
    mesh, owner = plots.place([TRIANGLE], trees)
    np.testing.assert_allclose(mesh.vertices_m, [[10, 20, 8], [10, 22, 9.5], [8, 20, 11]])
    assert owner.tolist() == [0]


def test_the_area_of_stretched_trees_is_that_of_their_copies():
    trees = planted()
    mesh, owner = plots.place([TRIANGLE, TRIANGLE], trees)
    np.testing.assert_allclose(
        plots.stretched_area_m2([TRIANGLE, TRIANGLE], trees),
        np.bincount(owner, mesh.element_area_m2),
    )


def test_field_trees_stand_inside_and_whole_crowns_come_first():
    trees = planted()
    chosen = plots.sample(trees, SIZE_M, 5, seed=1)
    assert chosen.sum() == 5
    margin = trees.crown_radius_m
    whole = trees.x_m.between(margin, SIZE_M[0] - margin)
    whole &= trees.y_m.between(margin, SIZE_M[1] - margin)
    assert whole[chosen].all()
    every = plots.sample(trees, SIZE_M, 500, seed=1)
    assert (every == trees.inside).all()


def test_the_ground_rises_by_its_slope_and_waves():
    flat = terrain.undulating(slope=0.1, wave_height_m=0.0, seed=2)
    mesh = flat.mesh([0, 0], [10, 10], 1.0)
    normal = mesh.element_normal
    np.testing.assert_allclose(normal[:, 2], 1 / np.hypot(1, 0.1))
    waves = terrain.undulating(slope=0.0, wave_height_m=1.5, seed=2)
    z = waves.mesh([0, 0], [100, 100], 1.0).vertices_m[:, 2]
    assert 0.5 < np.abs(z).max() <= 1.5


def test_the_terrain_mesh_fills_its_rectangle_facing_up():
    mesh = GROUND.mesh([-3.0, -3.0], [10.1, 7.3], 0.25)
    assert (mesh.triangle_normal[:, 2] > 0).all()
    assert 0.5 * mesh.triangle_normal[:, 2].sum() == pytest.approx(13.1 * 10.3)


LCC = {"mean_ug_cm2": 39.9, "sd_ug_cm2": 10.8, "range_ug_cm2": (10.0, 70.0)}
SOIL = {"brightness": 1.0, "moisture": 0.4, "litter_share": 0.4}


def test_chlorophyll_follows_the_table():
    lcc = plot_optics.chlorophyll(20_000, **LCC, seed=1)
    assert lcc.mean() == pytest.approx(39.9, abs=0.3)
    assert lcc.std() == pytest.approx(10.8, rel=0.04)
    assert lcc.min() >= 10
    assert lcc.max() <= 70


def test_a_mean_outside_its_range_is_refused():
    with pytest.raises(InputError, match="lcc_mean"):
        plot_optics.chlorophyll(3, **LCC | {"mean_ug_cm2": 80.0}, seed=1)


@pytest.mark.parametrize("ratio", [0.6, 1.0, 1.5])
def test_layers_keep_the_mean_of_the_tree(ratio):
    rng = np.random.default_rng(1)
    layer, area = rng.integers(0, 5, 1000), rng.uniform(0.001, 0.02, 1000)
    factor = plot_optics.part_factor(layer, area, np.zeros((5, 1)), ratio)
    assert (factor[layer] * area).sum() == pytest.approx(area.sum())
    assert factor[0] / factor[-1] == pytest.approx(ratio)


def test_kinds_of_shoots_differ_about_the_mean_of_their_tree():
    rng = np.random.default_rng(2)
    part, area = rng.integers(0, 15, 3000), rng.uniform(0.001, 0.02, 3000)
    deviation = rng.normal(0.0, 0.1, (5, 3))
    factor = plot_optics.part_factor(part, area, deviation, 1.0)
    assert (factor[part] * area).sum() == pytest.approx(area.sum())
    assert factor / factor[0] == pytest.approx((1 + deviation).ravel() / (1 + deviation[0, 0]))


def test_a_camera_as_built_has_bells_beside_its_windows():
    nm = np.arange(400.0, 1000.0)
    true = plot_optics.as_built(ZHAO, centre_sd_nm=0.0, width_sd=0.0, seed=1)
    for band, bell in zip(ZHAO, true, strict=True):
        at, response = np.array(bell.response).T
        above = np.interp(nm, at, response, 0, 0) > 0.5
        assert np.ptp(nm[above]) == pytest.approx(band.width_nm, abs=3)
    moved = camera_mean(nm, nm, plot_optics.as_built(ZHAO, centre_sd_nm=2.0, width_sd=0.1, seed=1))
    beside = np.abs(moved - [band.centre_nm for band in ZHAO])
    assert 0.2 < beside.mean() < 4.0
    assert moved == pytest.approx(
        camera_mean(nm, nm, plot_optics.as_built(ZHAO, centre_sd_nm=2.0, width_sd=0.1, seed=1))
    )


def test_the_lowest_shoots_are_in_the_lowest_layer():
    z = np.array([1.0, 5.0, 9.0])
    vertices = np.concatenate([TRIANGLE.vertices_m * [1, 1, 0] + [0, 0, each] for each in z])
    mesh = Mesh(vertices, np.arange(9, dtype=np.int32).reshape(3, 3), np.arange(3, dtype=np.int32))
    assert plot_optics.layers(mesh, 4).tolist() == [0, 2, 3]


def test_more_chlorophyll_means_darker_needles_in_red_edge_and_not_in_infrared():
    reflectance, transmittance = plot_optics.needles(
        np.array([20.0, 60.0]),
        ZHAO,
        structure_n=1.6,
        dry_matter_g_cm2=0.012,
        brown=0.05,
        water_cm=0.015,
        chlorophyll_per_carotenoid=4.0,
    )
    assert (reflectance[0, 1:4] > reflectance[1, 1:4]).all()
    assert reflectance[0, 4] == pytest.approx(reflectance[1, 4], rel=0.01)
    assert (reflectance + transmittance < 1).all()


def test_the_ground_is_patchy_about_its_means():
    xy = np.random.default_rng(1).uniform(0, 300, (20_000, 2))
    even = plot_optics.ground_patches(xy, ZHAO, **SOIL, variation=0.0, seed=1)
    patchy = plot_optics.ground_patches(xy, ZHAO, **SOIL, variation=0.2, seed=1)
    assert np.ptp(even, axis=0).max() < 1e-12
    np.testing.assert_allclose(patchy.mean(axis=0), even[0], rtol=0.1)
    assert (patchy.std(axis=0) > 0.02 * even[0]).all()
    near = plot_optics.ground_patches(xy + 0.05, ZHAO, **SOIL, variation=0.2, seed=1)
    assert np.abs(near - patchy).max() < 0.3 * np.ptp(patchy)
