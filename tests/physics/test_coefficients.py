"""Images of paths that were traced once, against closed forms and against other tracers."""

from dataclasses import replace

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats import meshes
from dapple.formats.meshes import Mesh
from dapple.frames import direction_from_angles
from dapple.light import brf
from dapple.retrieval import coefficients, image_paths, rendered_images
from dapple.retrieval.coefficients import Combinations, Window
from dapple.scene import traced
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds

SUN = direction_from_angles(40.0, 250.0)
WINDOW = Window(0.0, 4.0, 0.2, 20, 20)


def quad(x, y, z):
    """A rectangle; z is a height or a function of x and y."""
    z = z if callable(z) else lambda *_, height=z: height
    corners = [(a, b, z(a, b)) for a, b in ((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]))]
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(np.array(corners, float), faces, np.zeros(2, np.int32))


def canopy(n=250, seed=3):
    """Leaf discs over a slope."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places = rng.uniform([0, 0, 1.0], [4, 4, 3.0], (n, 3))
    leaves = meshes.of_discs(np.column_stack([np.full(n, 0.15), places, normals]))
    slope = quad((-8, 12), (-8, 12), lambda x, _: 0.8 + 0.1 * x)
    return Scene(of_kinds(leaf=leaves, ground=slope))


def trace(scene, window=WINDOW, sun=SUN, **more):
    settings = {"n_paths": 16, "seed": 1, "max_orders": 60, **more}
    return image_paths.trace(traced.load(scene), window, sun, **settings)


@pytest.fixture(scope="module")
def of_canopy():
    return trace(canopy(), n_paths=64)


def image(traced_once, rho=0.0, tau=0.0, soil=0.0, sky=0.0, bark=0.0):
    return coefficients.images(traced_once, Combinations(rho, tau, bark, soil, sky))[0]


def exact_mean(traced_once, rho, tau, soil, sky):
    """Mean of the image from the kinds of paths, without any projection."""
    optics = Optics.of_tree(*(np.array([x]) for x in (800.0, rho, tau, 0.0, soil)))
    sun, from_sky = (
        traced_once.light @ traced_once.counters.spectral_factor(traced_once.orders, optics)[:, 0]
    )
    return (1 - sky) * sun + sky * from_sky


def test_bare_ground_has_its_own_reflectance_in_every_pixel():
    bare = trace(Scene())
    for sky in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(image(bare, soil=0.37, sky=sky), 0.37, rtol=1e-6)


def test_a_slope_is_as_bright_as_it_faces_the_sun_and_as_much_sky_as_it_sees():
    slope = Scene(of_kinds(ground=quad((-50, 50), (-50, 50), lambda x, _: 100 - 0.5 * x)))
    seen = trace(slope)
    normal = np.array([0.5, 0.0, 1.0]) / np.hypot(0.5, 1.0)
    little = 1e-6  # so that light does not go back and forth between slope and plane
    lit = image(seen, soil=little) / little
    np.testing.assert_allclose(lit, normal @ SUN / SUN[2], rtol=1e-4)
    under_sky = image(seen, soil=little, sky=1.0).mean() / little
    assert under_sky == pytest.approx((1 + normal[2]) / 2, abs=0.01)


def test_a_slope_that_faces_away_from_the_sun_is_dark():
    steep = quad((-50, 50), (-50, 50), lambda x, _: 200 - 3 * x)
    towards_west = direction_from_angles(60.0, 270.0)
    assert image(trace(Scene(of_kinds(ground=steep)), sun=towards_west), soil=1e-6).max() < 1e-9


def test_a_leaf_over_everything_shares_light_with_the_ground_by_a_geometric_series():
    covered = trace(Scene(of_kinds(leaf=quad((-400, 400), (-400, 400), 1.0))), n_paths=400)
    rho, tau, soil = 0.45, 0.35, 0.4
    np.testing.assert_allclose(image(covered, rho, tau), rho, atol=2e-3)  # black ground
    for sky in (0.0, 1.0):
        mean = image(covered, rho, tau, soil, sky).mean()
        assert mean == pytest.approx(rho + tau**2 * soil / (1 - rho * soil), rel=0.01)


def test_nothing_is_lost_where_nothing_absorbs(of_canopy):
    """Under an even sky all that neither absorbs nor shines is as bright as the sky."""
    assert image(of_canopy, 0.5, 0.5, 1.0, sky=1.0).mean() == pytest.approx(1.0, abs=1e-6)
    assert image(of_canopy, 0.55, 0.45, 1.0, sky=1.0).mean() == pytest.approx(1.0, abs=0.02)


def test_the_mean_is_that_of_views_of_the_whole_window(of_canopy):
    scene = traced.load(canopy())
    views = brf.Views(
        np.array([[0.0, 0.0, 6.0]]), np.array([[4.0, 0, 0]]), np.array([[0, 4.0, 0]]),
        np.array([[0.0, 0.0, -1.0]]),
    )  # fmt: skip
    received = brf.collect(scene, views, SUN, n_paths=40_000, max_orders=60, seed=5)
    for rho, tau, soil, sky in ((0.1, 0.05, 0.2, 0.3), (0.5, 0.4, 0.3, 0.1), (0.35, 0.55, 0.1, 0)):
        optics = Optics.of_tree(*(np.array([x]) for x in (800.0, rho, tau, 0.0, soil)))
        value, error = brf.reflectance_factor(received, optics, diffuse_share=sky)
        found = image(of_canopy, rho, tau, soil, sky).mean()
        assert found == pytest.approx(value[0, 0], abs=4 * 1.3 * error[0, 0])
        assert error[0, 0] < 0.01


@pytest.mark.parametrize("n_columns", [4, 16])
def test_the_mean_is_exact_however_few_functions_are_kept(n_columns):
    few = trace(canopy(), n_columns=n_columns)
    for optics in ((0.05, 0.02, 0.3, 0.4), (0.37, 0.6, 0.1, 0.1), (0.62, 0.37, 0.5, 0.0)):
        expected = exact_mean(few, *optics)
        assert image(few, *optics).mean(dtype=float) == pytest.approx(expected, rel=1e-5)


def test_pixels_differ_little_from_those_with_many_functions():
    many = trace(canopy(), n_columns=120)
    usual = trace(canopy())
    for optics in ((0.05, 0.02, 0.3, 0.4), (0.37, 0.6, 0.1, 0.1), (0.6, 0.37, 0.5, 0.0)):
        difference = image(usual, *optics) - image(many, *optics)
        told = coefficients.projection_error(usual, Combinations(*optics[:2], 0.0, *optics[2:]))
        assert np.sqrt((difference**2).mean()) < 4 * told.item() < 0.01


def test_the_spread_of_the_independent_sets_tells_the_noise(of_canopy):
    optics = Combinations(0.45, 0.4, 0.0, 0.3, 0.1)
    other = trace(canopy(), n_paths=64, seed=9)
    sets, others = (
        np.einsum("scx,x->sc", one.cells, coefficients.spectral_columns(one, optics)[:, 0, 0])
        for one in (of_canopy, other)
    )
    pixels = np.bincount(WINDOW.cells(3.0)[0])
    share = pixels / pixels.sum()
    error = np.sqrt((sets.var(axis=0, ddof=1) / 4) @ share**2)
    assert 0 < error < 0.01
    assert sets.mean(axis=0) @ share == pytest.approx(others.mean(axis=0) @ share, abs=6 * error)


def test_chunks_make_up_the_image(of_canopy):
    rho, tau, soil = np.array([[0.1, 0.5], [0.3, 0.4]]), np.array([[0.1, 0.4]]), [[0.2, 0.3]]
    share = [0.3, 0.1]
    both = Combinations(rho, tau, 0.0, soil, share)
    chunks = coefficients.image_chunks(of_canopy, both, pixels_per_chunk=150)
    whole = np.concatenate([values for _, values in chunks])
    one = coefficients.images(of_canopy, Combinations(rho[1], tau[0], 0.0, soil[0], share))
    np.testing.assert_allclose(whole[:, 1].T.reshape(2, 20, 20), one, rtol=1e-5)


def test_tiles_change_nothing(monkeypatch, of_canopy):
    monkeypatch.setattr(brf, "PATHS_PER_KERNEL", 64 * 7)
    tiled = trace(canopy(), Window(0.0, 4.0, 0.2, 2, 20), n_paths=64)
    strip = of_canopy.table[:40]
    # The functions come from other pilots; what they stand for is the same.
    first = image(replace(of_canopy, window=Window(0, 4, 0.2, 2, 20), table=strip), 0.4, 0.4, 0.2)
    np.testing.assert_allclose(image(tiled, 0.4, 0.4, 0.2), first, atol=2e-3)


def test_north_is_up_and_shade_falls_away_from_the_sun():
    leaf = quad((3.0, 3.4), (3.4, 3.8), 2.0)
    scene = Scene(of_kinds(leaf=leaf, ground=quad((-9, 9), (-9, 9), 0.0)))
    west = direction_from_angles(45.0, 90.0)  # the sun in the east: shade 2 m to the west
    seen = trace(scene, sun=west)
    bright = image(seen, rho=0.5, soil=0.2)
    rendered = rendered_images.Renderer(scene).render(
        WINDOW, west, Optics.of_tree(*(np.array([x]) for x in (800.0, 0.5, 0.0, 0.0, 0.2))),
        np.zeros(1), n_paths=16, seed=1,
    ).image[0]  # fmt: skip
    for one in (bright, rendered):
        assert np.all(one[1:3, 15:17] > 0.4)
        assert np.all(one[1:3, 5:7] < 0.05)
        assert one[10:].mean() == pytest.approx(0.2, abs=2e-3)


def test_direct_renders_agree(of_canopy):
    optics = Optics.of_tree(
        np.arange(4.0), *(np.array(x) for x in (
            [0.05, 0.1, 0.35, 0.55], [0.01, 0.15, 0.5, 0.4], [0.0] * 4, [0.1, 0.2, 0.3, 0.4]
        ))
    )  # fmt: skip
    share = np.array([0.4, 0.3, 0.2, 0.1])
    made = rendered_images.Renderer(canopy()).render(
        WINDOW, SUN, optics, share, n_paths=256, n_passes=4, seed=2
    )
    surfaces = Combinations(
        optics.reflectance["leaf"], optics.transmittance["leaf"],
        optics.reflectance["wood"], optics.reflectance["ground"], share,
    )  # fmt: skip
    ours = coefficients.images(of_canopy, surfaces)
    error = made.passes.mean(axis=(2, 3)).std(axis=0, ddof=1) / 2
    difference = (made.image - ours).mean(axis=(1, 2))
    assert (np.abs(difference) < 4 * np.hypot(error, 1.5e-3)).all()
    pixels = np.corrcoef(made.image[0].ravel(), ours[0].ravel())[0, 1]
    assert pixels > 0.95


def test_a_renderer_takes_new_colours_every_time():
    renderer = rendered_images.Renderer(canopy())
    dark, bright = (
        Optics.of_tree(*(np.array([x]) for x in (800.0, *values)))
        for values in ((0.02, 0.01, 0.0, 0.05), (0.5, 0.4, 0.0, 0.4))
    )
    settings = {"n_paths": 16, "seed": 3}
    once = renderer.render(WINDOW, SUN, bright, [0.2], **settings).image
    assert renderer.render(WINDOW, SUN, dark, [0.2], **settings).image.mean() < 0.2 * once.mean()
    again = renderer.render(WINDOW, SUN, bright, [0.2], **settings).image
    np.testing.assert_allclose(again, once, rtol=1e-5)


def test_a_sun_below_the_horizon_is_an_error():
    with pytest.raises(InputError, match="above the horizon"):
        trace(Scene(), sun=direction_from_angles(95.0, 0.0))


def test_terrain_below_the_flat_ground_is_an_error():
    hollow = Scene(of_kinds(ground=quad((0, 1), (0, 1), -0.5)))
    with pytest.raises(InputError, match="where the terrain is lowest"):
        traced.load(hollow)
