"""What the terms of Semi-LESS mean, and how far its fit goes."""

import numpy as np
import pytest
import xarray as xr

from dapple.formats.meshes import Mesh
from dapple.frames import direction_from_angles
from dapple.optics.leaf import leaf_spectra
from dapple.retrieval import coefficients, image_paths, semiless
from dapple.retrieval.coefficients import Window
from dapple.scene import traced
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds

NADIR = np.array([0.0, 0.0, 1.0])
RHO = 0.6


def screen(half_width_m=30.0, strip_m=0.1):
    """Opaque strips 3 m above the ground, with gaps as wide as they are."""
    low = np.arange(-half_width_m, half_width_m, 2 * strip_m)
    ends = (-half_width_m, half_width_m)
    corners = [[(a, b), (a + strip_m, b)] for a in low for b in ends]
    corners = np.array(corners).reshape(-1, 2)
    first = 4 * np.arange(len(low))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [1, 3, 2]])).reshape(-1, 3)
    vertices = np.column_stack([corners, np.full(len(corners), 3.0)])
    return Scene(
        of_kinds(leaf=Mesh(vertices, faces.astype(np.int32), np.repeat(np.arange(len(low)), 2)))
    )


def layer():
    """A turbid layer, wide as seen from its middle, whose leaves let sun and view in by chance."""
    return Scene(
        voxels=xr.Dataset(
            {"plant_area_density_m2_m3": (("x", "y", "z"), np.full((30, 30, 1), 1.0))},
            coords={"x": 2.0 * np.arange(30) - 29, "y": 2.0 * np.arange(30) - 29, "z": [1.5]},
            attrs={"voxel_size_m": 2.0, "leaf_angle_distribution": "spherical"},
        )
    )


def means(scene, sun, *, n_paths=1000):
    """Function from soil to the mean reflectance of a small window, and the kinds of paths."""
    window = Window(-0.5, 0.5, 0.1, 10, 10)
    traced_once = image_paths.trace(traced.load(scene), window, sun, n_paths=n_paths, seed=1)

    def mean(soil):
        optics = Optics.of_tree(*(np.array([x]) for x in (800.0, RHO, 0.0, 0.0, soil)))
        factor = traced_once.counters.spectral_factor(traced_once.orders, optics)
        return (traced_once.light[0] @ factor)[0]

    return mean, traced_once


def terms(mean):
    return semiless.solve(np.array([mean(soil) for soil in semiless.SOILS]), semiless.SOILS)


def test_the_solution_gives_the_formula_back():
    rng = np.random.default_rng(0)
    rho_so, t1, rho_dd, t2 = rng.uniform([0, 0.1, 0.05, -0.3], [0.4, 0.9, 0.6, 0.3], (50, 4)).T
    four = np.stack(
        [semiless.formula(rho_so, t1, rho_dd, rho_dd * t2, r) for r in semiless.SOILS], axis=-1
    )
    found = semiless.solve(four, semiless.SOILS)
    for one, expected in zip(found, (rho_so, t1, rho_dd, rho_dd * t2), strict=True):
        np.testing.assert_allclose(one, expected, atol=1e-9)


def test_no_light_from_above_leaves_a_straight_line():
    four = 0.1 + 0.4 * np.array(semiless.SOILS)
    assert semiless.solve(four, semiless.SOILS) == pytest.approx((0.1, 0.4, 0.0, 0.0))


def test_t1_is_all_light_of_one_ground_reflection():
    mean, traced_once = means(screen(), NADIR)
    counters = traced_once.counters
    once = traced_once.orders[:, counters.reflected("ground")] == 1
    optics = Optics.of_tree(*(np.array([x]) for x in (800.0, RHO, 0.0, 0.0, 1.0)))
    light = (traced_once.light[0] * once) @ counters.spectral_factor(traced_once.orders, optics)
    assert terms(mean)[1] == pytest.approx(light[0], abs=2e-3)


def test_t2_is_what_sun_and_view_have_in_common():
    """Strips with gaps, sun and view both from the zenith: they go through the same gaps.

    With gaps of a share g: τ_ssoo = g, τ_ss τ_oo = g². A transmittance or a product would be g or
    g² (or T1, about 2 g), and leave a bright soil wrong.
    """
    g = 0.5
    mean, _ = means(screen(), NADIR)
    rho_so, t1, rho_dd, product = terms(mean)
    assert rho_so == pytest.approx(RHO * (1 - g), abs=0.01)
    assert rho_dd == pytest.approx(RHO * (1 - g), abs=0.02)
    assert product / rho_dd == pytest.approx(g - g**2, abs=0.03)
    right, wrong = (
        abs(semiless.formula(rho_so, t1, rho_dd, rho_dd * t2, 0.65) - mean(0.65))
        for t2 in (product / rho_dd, t1)
    )
    assert right < 1e-3
    assert wrong > 0.02


def test_t2_is_nothing_where_sun_and_view_meet_other_leaves():
    mean, _ = means(layer(), direction_from_angles(50.0, 120.0))
    rho_so, t1, rho_dd, product = terms(mean)
    assert abs(product) < 0.06 * rho_dd * t1
    assert semiless.formula(rho_so, t1, rho_dd, product, 0.35) == pytest.approx(
        mean(0.35), abs=1e-4
    )


def test_the_fit_holds_for_its_own_leaf_structure_and_less_for_others():
    window = Window(-0.5, 0.5, 0.1, 10, 10)
    sun = direction_from_angles(50.0, 120.0)
    traced_once = image_paths.trace(traced.load(layer()), window, sun, n_paths=32, seed=1)
    share = [0.3, 0.2, 0.1]
    fitted = semiless.fit(traced_once, share)
    error = {}
    for n in (1.5, 2.5):
        rho, tau = leaf_spectra(np.array([560.0, 720.0, 840.0]), n=n)
        soil = np.array([0.1, 0.2, 0.3])
        exact = coefficients.images(
            traced_once, coefficients.Combinations(rho, tau, 0.0, soil, share)
        )
        fast = semiless.images(fitted, rho, tau, soil)
        error[n] = np.abs((fast - exact).mean(axis=(1, 2))).max()
    assert error[1.5] < 2e-3
    assert error[2.5] > 4 * error[1.5]
