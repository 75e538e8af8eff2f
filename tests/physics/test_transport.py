"""The transport engine against closed forms."""

import numpy as np
import pytest
from scipy.special import expn
from tests.physics.slab import transmitted_irradiance, turbid_slab

from dapple.formats.meshes import Mesh
from dapple.light import traced, transport
from dapple.light.patches import patches
from dapple.light.scene import Optics, Scene

SENSOR = np.array([[0.0, 0.0, 0.5]])


def optics(leaf_reflectance, leaf_transmittance, bark=0.0, ground=0.0):
    bands = np.atleast_1d(np.asarray(leaf_reflectance, float))
    return Optics(
        wavelength_nm=np.full(bands.shape, 550.0),
        leaf_reflectance=bands,
        leaf_transmittance=np.full(bands.shape, leaf_transmittance, float),
        bark_reflectance=np.full(bands.shape, bark, float),
        ground_reflectance=np.full(bands.shape, ground, float),
    )


def collect(scene, sensors_m=SENSOR, n_paths=40_000, max_orders=30, n_patches=145, seed=1):
    return transport.collect(
        traced.load(scene),
        sensors_m,
        n_paths=n_paths,
        n_patches=n_patches,
        max_orders=max_orders,
        seed=seed,
    )


def total(counted, leaf, radiance=None):
    """Mean and standard error of irradiance, over replicates, first sensor, time and band."""
    if radiance is None:
        radiance = np.ones((1, counted.n_patches))
    both = [transport.irradiance(counted, radiance, leaf, scattered=s) for s in (False, True)]
    values = (both[0] + both[1])[0, :, 0, 0]
    return values.mean(), values.std(ddof=1) / np.sqrt(len(values))


def quad(corners):
    return Mesh(
        np.array(corners, float),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.zeros(2, np.int32),
    )


def test_an_open_sky_of_radiance_one_gives_pi():
    mean, error = total(collect(Scene()), optics(0.1, 0.1))
    assert mean == pytest.approx(np.pi, rel=1e-12)
    assert error == 0


def test_a_sky_seen_through_the_patches_keeps_its_cosine_weighted_integral():
    sky = patches(577)
    radiance = 1 + sky.directions[None, :, 2]
    counted = collect(Scene(), n_patches=577)
    expected = (radiance[0] * sky.projected_solid_angle_sr).sum()
    assert total(counted, optics(0, 0), radiance)[0] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("leaf_area_index", [0.5, 2.0, 4.0])
def test_a_black_layer_lets_twice_the_third_exponential_integral_through(leaf_area_index):
    counted = collect(Scene(voxels=turbid_slab(leaf_area_index)), n_paths=100_000)
    mean, error = total(counted, optics(0, 0))
    assert mean / np.pi == pytest.approx(2 * expn(3, 0.5 * leaf_area_index), abs=4 * error)
    assert error / np.pi < 2e-3


@pytest.mark.parametrize("leaf_area_index", [0.5, 1.0, 3.0, 6.0])
@pytest.mark.parametrize("half_albedo", [0.05, 0.45])
def test_a_scattering_layer_agrees_with_discrete_ordinates(leaf_area_index, half_albedo):
    counted = collect(Scene(voxels=turbid_slab(leaf_area_index)), n_paths=200_000, max_orders=60)
    mean, error = total(counted, optics(half_albedo, half_albedo))
    expected = transmitted_irradiance(leaf_area_index, half_albedo, half_albedo)
    assert mean == pytest.approx(expected, abs=max(0.02 * expected, 4 * error))


def test_nothing_is_lost_where_nothing_absorbs():
    rng = np.random.default_rng(3)
    centres = rng.uniform([-1, -1, 0.8], [1, 1, 1.6], (300, 3))
    normals = rng.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    along = np.cross(normals, rng.normal(size=(300, 3)))
    along *= 0.1 / np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(normals, along)
    corners = centres[:, None] + np.stack(
        [along + across, along - across, -along - across, across - along], axis=1
    )
    faces = np.arange(300)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])
    leaves = Mesh(
        corners.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(300), 2).astype(np.int32),
    )
    counted = collect(Scene({"leaf": leaves}, turbid_slab(0.5)), max_orders=120)
    mean, error = total(counted, optics(0.6, 0.4, ground=1.0))
    assert error > 0
    assert mean == pytest.approx(np.pi, abs=4 * error)


def test_bark_above_ground_returns_light_by_the_series_of_two_lambertian_planes():
    """An opaque white ceiling over grey ground lets nothing in from the sides of an endless gap."""
    ceiling = quad([[-500, -500, 1], [500, -500, 1], [500, 500, 1], [-500, 500, 1]])
    counted = collect(Scene({"wood": ceiling}), n_paths=4000, max_orders=20)
    assert total(counted, optics(0, 0, bark=0.5, ground=0.5))[0] < 1e-3 * np.pi


def test_the_same_seed_gives_the_same_counts():
    first, second = (collect(Scene(voxels=turbid_slab(1.0)), n_paths=8000) for _ in range(2))
    for name in ("sensor", "replicate", "patch", "orders", "count"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_a_sun_spread_over_patches_keeps_its_irradiance():
    sky = patches(2305)
    radiance = transport.sun_radiance(np.array([[0.6, 0.0, 0.8]]), sky, kernel_deg=8.0)
    assert (radiance * sky.solid_angle_sr).sum() == pytest.approx(1)
