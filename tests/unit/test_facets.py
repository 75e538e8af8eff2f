"""Facets that fill parts, and the terrain."""

import numpy as np
import pandas as pd
import pytest

from dapple.structure import facets, filled_crowns


def many(n=20_000, area=0.01):
    rng = np.random.default_rng(1)
    return facets.squares(rng.random((n, 3)), facet_area_m2=area, rng=rng)


def test_every_facet_is_a_square_of_the_asked_area():
    mesh = many(200)
    np.testing.assert_allclose(mesh.element_area_m2, 0.01)
    corners = mesh.vertices_m.reshape(-1, 4, 3)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    np.testing.assert_allclose(edges, 0.1)
    np.testing.assert_allclose(mesh.triangle_area_m2, 0.005)


def test_normals_are_spherical():
    """A unit of area then shows half of itself in every direction, and cos of tilt is even."""
    normal = many().element_normal
    for direction in np.eye(3):
        assert np.abs(normal @ direction).mean() == pytest.approx(0.5, abs=0.01)
    cosine = np.abs(normal[:, 2])
    np.testing.assert_allclose(np.quantile(cosine, [0.25, 0.5, 0.75]), [0.25, 0.5, 0.75], atol=0.02)


def test_squares_are_turned_in_their_own_plane_too():
    mesh = many()
    corner = mesh.vertices_m[::4] - mesh.vertices_m.reshape(-1, 4, 3).mean(axis=1)
    np.testing.assert_allclose(corner.mean(axis=0), 0, atol=0.002)


def test_numbers_add_up_to_the_area_of_all_parts():
    area = np.full(1000, 0.0031)
    counts = facets.numbers(area, 0.01)
    assert counts.sum() == round(area.sum() / 0.01)
    assert counts.min() >= 0
    assert facets.numbers(np.array([0.5, 0.0, 0.25]), 0.01).tolist() == [50, 0, 25]


def test_terrain_covers_the_map_and_follows_a_plane():
    y, x = np.mgrid[:40, :60] * 0.5 + 0.25
    ground = 0.1 * x - 0.2 * y
    mesh = facets.terrain(ground, left_m=10.0, top_m=100.0, pixel_m=0.5, step_m=1.0)
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    np.testing.assert_allclose([*low[:2], *high[:2]], [10, 80, 40, 100])
    expected = 0.1 * (mesh.vertices_m[:, 0] - 10) - 0.2 * (100 - mesh.vertices_m[:, 1])
    np.testing.assert_allclose(mesh.vertices_m[:, 2], expected, atol=1e-9)
    assert (mesh.triangle_normal[:, 2] > 0).all()
    assert mesh.n_elements == 30 * 20
    flat_m2 = 0.5 * mesh.triangle_normal[:, 2].sum()
    assert flat_m2 == pytest.approx(600)


def test_a_map_of_one_pixel_is_one_square():
    mesh = facets.terrain(np.full((1, 1), 3.0), left_m=0, top_m=1, pixel_m=1.0, step_m=5.0)
    assert mesh.area_m2 == pytest.approx(1.0)


def test_unknown_parts_take_their_layer_then_their_crown_then_all():
    table = pd.DataFrame({"crown": [1, 1, 1, 2, 3], "layer": [1, 1, 2, 1, 1]})
    density = np.array([2.0, np.nan, np.nan, np.nan, 1.0])
    filled = filled_crowns.fill_unknown(density, np.array([1.0, 1, 1, 1, 3]), table)
    np.testing.assert_allclose(filled, [2.0, 2.0, 2.0, (2 + 3) / 4, 1.0])


def test_a_scene_without_any_known_part_stays_empty():
    table = pd.DataFrame({"crown": [1, 1], "layer": [1, 2]})
    assert filled_crowns.fill_unknown(np.full(2, np.nan), np.ones(2), table).tolist() == [0, 0]
