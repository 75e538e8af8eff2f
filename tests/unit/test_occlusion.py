"""Leaves that no beam met: their area is given back, and nothing where all was seen."""

import numpy as np
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.structure import occlusion
from dapple.structure.voxel_data import CAPPED

SIZE, SHAPE, DENSITY, LEAF_M = 0.2, (10, 10, 10), 2.0, 0.05
LEAF_M2 = 0.5 * LEAF_M**2


def medium(rng, density=DENSITY):
    """Triangles of one size at random in a cube of 2 m."""
    n = round(density * np.prod(SHAPE) * SIZE**3 / LEAF_M2)
    corner = np.array([[0.0, 0, 0], [LEAF_M, 0, 0], [0, LEAF_M, 0]]) - LEAF_M / 3
    angle = rng.uniform(0, 2 * np.pi, n)
    turn = np.zeros((n, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = -np.sin(angle), np.sin(angle), 1
    place = rng.uniform(0, 1, (n, 1, 3)) * np.array(SHAPE) * SIZE
    vertices = (np.einsum("nij,kj->nki", turn, corner) + place).reshape(-1, 3)
    return Mesh(
        vertices, np.arange(3 * n, dtype=np.int32).reshape(-1, 3), np.arange(n, dtype=np.int32)
    )


def some(mesh, kept):
    """The chosen single-triangle elements."""
    faces = mesh.faces[kept]
    return Mesh(mesh.vertices_m, faces, np.arange(len(faces), dtype=np.int32))


def voxels(density, n_shots, cap=None):
    """Voxels as the estimator gives them, with a path of 0.13 m a shot."""
    dims = ("x", "y", "z")
    density, n_shots = np.broadcast_to(density, SHAPE), np.broadcast_to(n_shots, SHAPE)
    capped = density >= cap if cap else np.zeros(SHAPE, bool)
    data = {
        "plant_area_density_m2_m3": density.astype(float),
        "n_shots": n_shots,
        "entering": n_shots.astype(float),
        "intercepted": 0.1 * n_shots,
        "path_length_m": 0.13 * n_shots,
        "flag": (CAPPED * capped).astype(np.uint8),
    }
    coords = {a: (np.arange(n) + 0.5) * SIZE for a, n in zip(dims, SHAPE, strict=True)}
    return xr.Dataset({k: (dims, v) for k, v in data.items()}, coords, {"voxel_size_m": SIZE})


def shots_by_half(few=50, many=5000):
    """A cube whose upper half is seen by few beams."""
    number = np.full(SHAPE, many)
    number[:, :, 5:] = few
    return number


def test_the_hidden_half_of_a_random_medium_gets_its_area_back():
    rng = np.random.default_rng(1)
    true = medium(rng)
    upper = true.element_centre_m[:, 2] > 1.0
    seen = some(true, ~upper | (rng.random(true.n_elements) < 0.3))
    corrected = occlusion.correct(seen, voxels(DENSITY, shots_by_half()), seed=1)
    assert corrected.area_m2 == pytest.approx(true.area_m2, rel=0.02)
    added = corrected.element_centre_m[seen.n_elements :]
    # Copies keep their size and lie in the cells that lack them, evenly.
    assert (added[:, 2] > 1.0).mean() > 0.97
    assert added[added[:, 2] > 1.0].mean(axis=0) == pytest.approx([1.0, 1.0, 1.5], abs=0.03)
    np.testing.assert_allclose(corrected.element_area_m2, LEAF_M2)


def test_polygons_that_were_found_stay_as_they_were():
    rng = np.random.default_rng(2)
    seen = some(medium(rng), np.arange(2000))
    corrected = occlusion.correct(seen, voxels(DENSITY, shots_by_half()), seed=1)
    assert corrected.n_elements > seen.n_elements
    np.testing.assert_array_equal(corrected.vertices_m[: len(seen.vertices_m)], seen.vertices_m)
    np.testing.assert_array_equal(corrected.element[: len(seen.element)], seen.element)


def test_nothing_is_added_where_polygons_have_all_the_area():
    true = medium(np.random.default_rng(3), density=1.1 * DENSITY)
    assert occlusion.correct(true, voxels(DENSITY, shots_by_half()), seed=1) is true


def test_noise_of_single_voxels_does_not_add_leaves():
    rng = np.random.default_rng(4)
    true = medium(rng)
    noisy = DENSITY * rng.exponential(1.0, SHAPE)
    added = occlusion.correct(true, voxels(noisy, shots_by_half()), seed=1).area_m2 - true.area_m2
    # The sum over cells that look too thin alone would be e⁻¹ of the whole.
    assert added < 0.1 * true.area_m2


def test_what_no_beam_reached_is_like_its_surroundings_but_only_inside_the_crown():
    density = np.full(SHAPE, DENSITY)
    density[4:6, 4:6, 4:6] = np.nan  # a hole in the crown
    filled = occlusion.fill(density, SIZE, 0.5)
    np.testing.assert_allclose(filled, DENSITY)
    density = np.full(SHAPE, np.nan)
    density[:5] = DENSITY  # beyond the last leaf that was seen nothing is known
    assert (occlusion.fill(density, SIZE, 0.5)[5:] == 0).all()


def test_a_density_at_its_cap_does_not_make_polygons_look_complete():
    rng = np.random.default_rng(5)
    true = medium(rng)
    seen = some(true, rng.random(true.n_elements) < 0.5)
    density = np.full(SHAPE, DENSITY)
    density[::2] = 0.5  # at the cap: really as dense as the others
    lacking = occlusion.lacking_area(seen, voxels(density, 100, cap=None))[0]
    aware = voxels(density, 100)
    aware["flag"][::2] = CAPPED
    lacking_aware = occlusion.lacking_area(seen, aware)[0]
    assert lacking_aware[1::2].sum() == pytest.approx(0.25 * true.area_m2, rel=0.05)
    assert lacking[1::2].sum() < 0.7 * lacking_aware[1::2].sum()


def test_chance_comes_from_the_seed_alone():
    seen = some(medium(np.random.default_rng(6)), np.arange(1000))
    grid = voxels(DENSITY, shots_by_half())
    first, again, other = (occlusion.correct(seen, grid, seed=s).vertices_m for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or not np.array_equal(first, other)


def test_without_any_polygon_there_is_nothing_to_copy():
    none = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))
    with pytest.raises(InputError, match="no leaf polygon"):
        occlusion.correct(none, voxels(DENSITY, 100), seed=1)
