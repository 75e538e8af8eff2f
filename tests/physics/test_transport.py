"""The transport engine against closed forms."""

import drjit as dr
import numpy as np
import pytest
from scipy.special import expn
from tests.physics.slab import layer, transmitted_irradiance, turbid_slab

from dapple.formats.meshes import Mesh
from dapple.light import paths, tensor, transport
from dapple.light.transport import Growth
from dapple.scene import traced
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, Surface, of_kinds
from dapple.sky.patches import patches

SENSOR = np.array([[0.0, 0.0, 0.5]])
COLUMNS = ("sky_seen", "sensor", "replicate", "patch", "orders", "count", "n_paths", "cut")


def optics(leaf_reflectance, leaf_transmittance, bark=0.0, ground=0.0):
    bands = np.atleast_1d(np.asarray(leaf_reflectance, float))
    return Optics.of_tree(
        wavelength_nm=np.full(bands.shape, 550.0),
        leaf_reflectance=bands,
        leaf_transmittance=np.full(bands.shape, leaf_transmittance, float),
        wood_reflectance=np.full(bands.shape, bark, float),
        ground_reflectance=np.full(bands.shape, ground, float),
    )


def collect(scene, sensors_m=SENSOR, n_paths=40_000, max_orders=30, n_patches=145, **more):
    return transport.collect(
        traced.load(scene),
        sensors_m,
        n_paths=n_paths,
        n_patches=n_patches,
        max_orders=max_orders,
        **{"seed": 1, **more},
    )


def total(counted, leaf, radiance=None):
    """Mean and standard error of irradiance, over replicates, first sensor, time and band."""
    if radiance is None:
        radiance = np.ones((1, counted.n_patches))
    values = tensor.straight(counted, radiance)[0, :, 0]
    values = values + tensor.scattered(counted, radiance, leaf)[0, :, 0, 0]
    return values.mean(), values.std(ddof=1) / np.sqrt(len(values))


def quad(corners):
    return Mesh(
        np.array(corners, float),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.zeros(2, np.int32),
    )


def disc(radius, z, n=720):
    angle = np.arange(n) * 2.0 * np.pi / n
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, z)])
    faces = np.column_stack([np.zeros(n), 1 + np.arange(n), 1 + (np.arange(n) + 1) % n])
    vertices = np.concatenate([[[0.0, 0.0, z]], rim])
    return Mesh(vertices, faces.astype(np.int32), np.zeros(n, dtype=np.int32))


def leaf_cloud(n=300):
    """Square leaves of random position and tilt in a box above the sensor."""
    rng = np.random.default_rng(3)
    centres = rng.uniform([-1, -1, 0.8], [1, 1, 1.6], (n, 3))
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    along = np.cross(normals, rng.normal(size=(n, 3)))
    along *= 0.1 / np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(normals, along)
    corners = centres[:, None] + np.stack(
        [along + across, along - across, -along - across, across - along], axis=1
    )
    faces = np.arange(n)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        corners.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n), 2).astype(np.int32),
    )


MIXED = Scene(of_kinds(leaf=leaf_cloud()), turbid_slab(0.5))


def test_an_open_sky_of_radiance_one_gives_pi():
    mean, error = total(collect(Scene()), optics(0.1, 0.1))
    assert mean == pytest.approx(np.pi, rel=1e-12)
    assert error < 1e-12


def test_directions_fill_a_patch_evenly_in_height_and_around():
    uv = np.random.default_rng(1).random((4000, 2))
    east, north, up = np.moveaxis(patches(145).sample(uv)[:-1], -1, 0)
    around = north + 1j * east
    turn = np.angle(around / around[:, :1])
    related = [np.corrcoef(*one)[0, 1] for one in zip(up**2, turn, strict=True)]
    assert np.abs(related).max() < 0.08
    assert np.std(up**2, axis=1) == pytest.approx(np.ptp(up**2, axis=1) / np.sqrt(12), rel=0.05)


def test_a_sky_seen_through_the_patches_keeps_its_cosine_weighted_integral():
    sky = patches(577)
    radiance = 1 + sky.directions[None, :, 2]
    counted = collect(Scene(), n_patches=577)
    expected = (radiance[0] * sky.projected_solid_angle_sr).sum()
    assert total(counted, optics(0, 0), radiance)[0] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("radius", [0.5, 1.0, 4.0])
def test_a_leaf_overhead_hides_its_solid_angle_and_lets_its_transmittance_through(radius):
    """Each of its points gets pi from the sky, of which τ goes on evenly to all sides below."""
    counted = collect(Scene(of_kinds(leaf=disc(radius, 1.5))), n_paths=100_000)
    hidden = radius**2 / (1 + radius**2)
    for tau in (0.0, 0.4):
        mean, error = total(counted, optics(0.3, tau))
        assert mean / np.pi == pytest.approx(1 - hidden + tau * hidden, abs=4 * error / np.pi)
        assert error / np.pi < 2e-3


def test_an_endless_wall_gives_back_half_of_what_half_the_sky_gives_it():
    """It hides half the sky (π/2), and sends ρ/2 from there, as half the sky lights it."""
    far = 5000.0
    wall = quad([[0.5, -far, -1], [0.5, far, -1], [0.5, far, far], [0.5, -far, far]])
    mean, error = total(collect(Scene(of_kinds(wood=wall))), optics(0, 0, bark=0.6))
    assert mean == pytest.approx(np.pi / 2 * (1 + 0.6 / 2), abs=4 * error)


@pytest.mark.parametrize("leaf_area_index", [0.5, 2.0, 4.0])
def test_a_black_layer_lets_twice_the_third_exponential_integral_through(leaf_area_index):
    counted = collect(Scene(voxels=turbid_slab(leaf_area_index)), n_paths=100_000)
    mean, error = total(counted, optics(0, 0))
    assert mean / np.pi == pytest.approx(2 * expn(3, 0.5 * leaf_area_index), abs=4 * error)
    assert error / np.pi < 2e-3


@pytest.mark.parametrize("leaf_area_index", [0.5, 1.0, 3.0, 6.0])
def test_a_scattering_layer_agrees_with_discrete_ordinates(leaf_area_index):
    n_paths = 600_000 if leaf_area_index > 5 else 150_000
    scene = Scene(voxels=turbid_slab(leaf_area_index))
    counted = collect(scene, n_paths=n_paths, max_orders=90)
    for half_albedo in (0.05, 0.45):
        mean, error = total(counted, optics(half_albedo, half_albedo))
        expected = transmitted_irradiance(leaf_area_index, half_albedo, half_albedo)
        assert error < 0.01 * expected
        assert mean == pytest.approx(expected, abs=4 * error)
        assert mean == pytest.approx(expected, rel=0.02)


def test_a_repeated_cell_of_voxels_is_an_endless_layer():
    size_m, leaf_area_index = 2.0, 2.0
    layer = turbid_slab(leaf_area_index).isel(x=slice(0, 3), y=slice(0, 2))
    layer = (layer * 20.0 / size_m).assign_coords(x=[1.0, 3.0, 5.0], y=[1.0, 3.0], z=[2.0])
    layer = layer.assign_attrs(voxel_size_m=size_m)
    scene = traced.load(Scene(voxels=layer), cell_m=np.array([[0.0, 0.0], [6.0, 4.0]]))
    counted = transport.collect(
        scene,
        SENSOR + np.array([1.7, 3.2, 0.0]),
        n_paths=150_000,
        n_patches=145,
        max_orders=90,
        seed=1,
    )
    mean, error = total(counted, optics(0.4, 0.3))
    expected = transmitted_irradiance(leaf_area_index, 0.4, 0.3)
    assert mean == pytest.approx(expected, abs=4 * error)
    assert error < 0.01 * expected


def test_light_through_two_layers_is_the_same_from_either_side():
    """Reciprocity: swapping a thin and a thick layer changes what they reflect, not what passes."""
    leaf = optics(0.5, 0.3, ground=0.0)
    sides = [
        total(collect(Scene(voxels=turbid_slab(*order)), n_paths=150_000, max_orders=90), leaf)
        for order in ((0.4, 3.0), (3.0, 0.4))
    ]
    error = np.hypot(sides[0][1], sides[1][1])
    assert error < 0.01 * sides[0][0]
    assert sides[0][0] == pytest.approx(sides[1][0], abs=4 * error)


def test_grey_ground_and_a_layer_share_light_by_a_geometric_series():
    """Lambertian ground spreads light evenly: R and T of the layer are those of an even sky."""
    leaf_area_index, rho, tau, ground = 1.5, 0.4, 0.2, 0.6
    back, through = layer(leaf_area_index, rho, tau)
    node, weight = np.polynomial.legendre.leggauss(len(back))
    flux = weight / 2 * (node + 1)
    reflected, passed = (flux @ part.sum(axis=1) for part in (back, through))
    counted = collect(Scene(voxels=turbid_slab(leaf_area_index)), n_paths=150_000, max_orders=90)
    mean, error = total(counted, optics(rho, tau, ground=ground))
    assert mean / np.pi == pytest.approx(passed / (1 - ground * reflected), abs=4 * error / np.pi)
    assert error < 0.01 * mean


def test_nothing_is_lost_where_nothing_absorbs():
    counted = collect(MIXED, max_orders=250)
    mean, error = total(counted, optics(0.6, 0.4, ground=1.0))
    assert counted.cut.sum() == 0
    assert error > 0
    assert mean == pytest.approx(np.pi, abs=4 * error)


def test_ending_every_second_path_by_chance_changes_no_mean():
    whole, halved = (
        total(collect(MIXED, max_orders=200, halved_after=after), optics(0.5, 0.4, ground=0.8))
        for after in (None, 4)
    )
    assert whole[0] != halved[0]
    assert whole[0] == pytest.approx(halved[0], abs=4 * np.hypot(whole[1], halved[1]))


def test_what_is_cut_off_is_bounded():
    leaf = optics(0.5, 0.4, ground=0.8)
    cut, whole = (collect(MIXED, max_orders=orders) for orders in (3, 200))
    lost = total(whole, leaf)[0] - total(cut, leaf)[0]
    bound = np.pi * cut.truncated_share(leaf)[0]
    assert 0 < lost < bound < 10 * lost
    assert whole.truncated_share(leaf)[0] < 1e-6


def test_without_any_order_only_light_straight_from_the_sky_is_left():
    counted = collect(MIXED, n_paths=2000, max_orders=0)
    assert len(counted.count) == 0
    assert counted.cut[0] > 0
    straight = tensor.straight(counted, np.ones((1, 145))).mean()
    assert total(counted, optics(0.5, 0.4, ground=1.0))[0] == pytest.approx(straight)


def test_a_closed_box_lets_nothing_in():
    ceiling = quad([[-500, -500, 1], [500, -500, 1], [500, 500, 1], [-500, 500, 1]])
    counted = collect(Scene(of_kinds(wood=ceiling)), n_paths=4000, max_orders=20)
    assert total(counted, optics(0, 0, bark=0.5, ground=0.5))[0] < 1e-3 * np.pi


def test_plants_stored_once_scatter_at_every_place_like_plants_in_one_mesh():
    one = leaf_cloud(100)
    shift = np.array([[0.0, 0.0, 0.0], [0.7, -0.4, 0.5], [-0.6, 0.2, 1.0]])
    vertices = (one.vertices_m + shift[:, None]).reshape(-1, 3)
    faces = (one.faces + len(one.vertices_m) * np.arange(3)[:, None, None]).reshape(-1, 3)
    merged = Mesh(vertices, faces.astype(np.int32), np.zeros(len(faces), np.int32))
    scenes = Scene([Surface(one, places_m=shift)]), Scene(of_kinds(leaf=merged))
    found = [
        transport.collect(
            traced.load(scene), SENSOR, n_paths=40_000, n_patches=145, max_orders=60, seed=1
        )
        for scene in scenes
    ]
    (first, error), (second, _) = (total(c, optics(0.5, 0.4, ground=0.2)) for c in found)
    assert first == pytest.approx(second, abs=error)


def test_bands_summed_with_their_light_are_the_sum_of_all_bands():
    counted = collect(MIXED, n_paths=4000)
    leaf = optics([0.1, 0.3, 0.5], 0.1, ground=0.3)
    rng = np.random.default_rng(1)
    radiance, flux = rng.random((4, 145)), rng.random((4, 3))
    spectral = tensor.scattered(counted, radiance, leaf)
    summed = tensor.summed_scattered(counted, radiance, flux, leaf)
    np.testing.assert_allclose(summed, (spectral * flux).sum(axis=-1), rtol=1e-12)


def test_more_paths_start_where_the_light_is_uncertain_until_it_is_not():
    sensors = np.array([[0.0, 0.0, 0.5], [400.0, 0.0, 0.5]])
    scene, leaf = Scene(of_kinds(leaf=leaf_cloud())), optics(0.1, 0.05, ground=0.2)
    counted = collect(scene, sensors, n_paths=512, growth=Growth(0.002, 64.0, leaf, 8.0))
    assert counted.n_paths[0] > 4 * counted.n_paths[1]
    assert counted.n_paths[1] == 32
    assert tensor.nominal_error(counted, leaf, sun_kernel_deg=8.0).max() < 0.002
    capped = collect(scene, sensors, n_paths=512, growth=Growth(0.002, 2.0, leaf, 8.0))
    assert capped.n_paths[0] == 64


def test_paths_added_later_are_those_that_would_have_been_traced_at_once():
    scene, leaf = Scene(of_kinds(leaf=leaf_cloud())), optics(0.1, 0.05, ground=0.2)
    grown = collect(scene, n_paths=512, growth=Growth(0.002, 64.0, leaf, 8.0))
    at_once = collect(scene, n_paths=int(grown.n_paths[0]) * grown.n_replicates)
    assert grown.n_paths[0] > 32
    for name in COLUMNS[1:]:
        np.testing.assert_array_equal(getattr(grown, name), getattr(at_once, name))


def test_the_counts_depend_neither_on_threads_nor_on_blocks(monkeypatch):
    threads = dr.thread_count()
    try:
        found = []
        for n_threads, block in ((1, 1 << 20), (2, 1 << 20), (2, 5000)):
            dr.set_thread_count(n_threads)
            monkeypatch.setattr(paths, "PATHS_PER_KERNEL", block)
            found.append(collect(MIXED, n_paths=20_000, halved_after=6))
    finally:
        dr.set_thread_count(threads)
    for other in found[1:]:
        for name in COLUMNS:
            assert getattr(found[0], name).tobytes() == getattr(other, name).tobytes()


def test_a_sun_spread_over_patches_keeps_its_irradiance():
    sky = patches(2305)
    radiance = tensor.sun_radiance(np.array([[0.6, 0.0, 0.8]]), sky, kernel_deg=8.0)
    assert (radiance * sky.solid_angle_sr).sum() == pytest.approx(1)
