"""Shoots scatter less than their needles, because light meets a needle again before it leaves."""

import numpy as np
import pytest

from dapple.config.settings import Settings
from dapple.formats.meshes import Mesh
from dapple.retrieval.spectra import of_shoots
from dapple.scene import mitsuba_scene
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds
from dapple.virtual import conifers

N_RAYS = 400_000
TRUE_RECOLLISION = {"larch": 0.06, "spruce": 0.23}


def test_light_that_meets_no_second_needle_leaves_as_from_a_leaf():
    rho, tau = np.array([0.05, 0.45]), np.array([0.02, 0.43])
    for shoot, needle in zip(of_shoots(rho, tau, 0.0), (rho, tau), strict=True):
        np.testing.assert_array_equal(shoot, needle)


def test_needles_that_absorb_nothing_make_shoots_that_absorb_nothing():
    rho, tau = of_shoots(np.array([0.6]), np.array([0.4]), 0.47)
    assert rho + tau == pytest.approx(1.0)


def test_a_shoot_scatters_the_sum_of_all_orders():
    albedo, p = 0.8, 0.3
    orders = sum((1 - p) * albedo * (p * albedo) ** k for k in range(200))
    rho, tau = of_shoots(np.array([0.5]), np.array([0.3]), p)
    assert rho + tau == pytest.approx(orders)
    assert rho / tau == pytest.approx(0.5 / 0.3)


def apart(tree):
    """The shoots of a tree a metre from each other."""
    leaves, n = tree.leaves, tree.leaves.n_elements
    corners = leaves.vertices_m.reshape(n, -1, 3)
    columns = int(np.ceil(np.sqrt(n)))
    place = np.stack([np.arange(n) % columns, np.arange(n) // columns, np.ones(n)], axis=1)
    moved = corners - corners.mean(axis=1, keepdims=True) + place[:, None]
    return Mesh(moved.reshape(-1, 3), leaves.faces, leaves.element)


def recollision(mesh, rng):
    """Share of diffuse light from both sides of all needles that meets a needle again."""
    triangle = rng.integers(0, len(mesh.faces), N_RAYS)
    a, b, c = (mesh.vertices_m[mesh.faces[triangle, k]] for k in range(3))
    u, v = rng.random((2, N_RAYS, 1))
    start = a * (1 - np.sqrt(u)) + np.sqrt(u) * ((1 - v) * b + v * c)
    normal = np.cross(b - a, c - a)
    normal *= np.sign(rng.random((N_RAYS, 1)) - 0.5) / np.linalg.norm(normal, axis=1, keepdims=True)
    sphere = rng.normal(size=(N_RAYS, 3))
    way = normal + sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    loaded = mitsuba_scene.build(Scene(of_kinds(leaf=mesh)), Optics.of_tree(*np.full((5, 3), 0.2)))
    mi = loaded.mi
    ray = mi.Ray3f(*((x.T).astype(np.float32) for x in (start + 1e-5 * normal, way)))
    ray.maxt = 0.5
    return float(np.array(loaded.scene.ray_test(ray)).mean())


@pytest.mark.parametrize("species", ["larch", "spruce"])
def test_what_rays_find_in_the_virtual_shoots_is_not_what_the_retrieval_expects(species):
    settings = Settings(experiment="shoots").chlorophyll
    size = settings.world.model_dump(
        include={"shoot_length_m", "strip_width_m", "strips_per_shoot"}
    )
    tree = conifers.grow(species, leaf_area_m2=20.0, seed=1, **size)
    found = recollision(apart(tree), np.random.default_rng(2))
    assert found == pytest.approx(TRUE_RECOLLISION[species], abs=0.01)
    low, high, _ = settings.retrieval.shoot_recollision
    assert low < found < high
    assert abs(found - 0.5 * (low + high)) > 0.1
