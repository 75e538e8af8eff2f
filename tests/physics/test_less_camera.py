"""Images by LESS 3 against closed forms and against dapple's own camera."""

from importlib.util import find_spec

import numpy as np
import pytest

from dapple import frames
from dapple.formats.meshes import Mesh, concatenate
from dapple.frames import direction_from_angles
from dapple.virtual import camera, less_camera
from dapple.virtual.camera import View
from dapple.virtual.plot_optics import Materials

pytestmark = pytest.mark.skipif(find_spec("less") is None, reason="less3d is not installed")
SUN = {"sun_zenith_deg": 40.0, "sun_azimuth_deg": 150.0}


def square(width_m, normal, middle):
    """A square around a place."""
    ends = 0.5 * width_m * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = ends @ frames.across(np.asarray(normal, float)) + middle
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def by_less(mesh, materials, view, diffuse_share, paths=1500):
    bands = 450.0 + 100.0 * np.arange(materials.reflectance.shape[1])
    return less_camera.photograph(
        mesh, materials, view, wavelength_nm=bands, **SUN, diffuse_share=diffuse_share,
        paths_per_pixel=paths, seed=1,
    )  # fmt: skip


@pytest.mark.parametrize("tilt_deg", [0.0, 60.0])
def test_a_tilted_leaf_is_as_bright_as_its_tilt_tells(tilt_deg):
    """Reflectance r, transmittance t, above dark ground, in band 1 by the sun, in 2 by the sky."""
    r, t = 0.4, 0.3
    normal = direction_from_angles(tilt_deg, 330.0)
    leaf = square(2.0, normal, [5.0, 5.0, 4.0])
    ground = square(10.0, [0.0, 0.0, 1.0], [5.0, 5.0, 0.0])
    materials = Materials(
        np.array([[r, r], [0.0, 0.0]]), np.array([[t, t], [0.0, 0.0]]), np.array([0, 0, 1, 1])
    )
    view = View(4.8, 5.2, 2, 2, 0.2)
    image = by_less(concatenate([leaf, ground]), materials, view, np.array([0.0, 1.0]))
    towards_sun = direction_from_angles(SUN["sun_zenith_deg"], SUN["sun_azimuth_deg"])
    cosine = normal @ towards_sun
    by_sun = (r if cosine > 0 else t) * abs(cosine) / towards_sun[2]
    by_sky = r * (1 + normal[2]) / 2 + t * (1 - normal[2]) / 2
    assert image.mean(axis=(1, 2)) == pytest.approx([by_sun, by_sky], rel=0.01)


def test_both_renderers_see_the_same_leaves_and_ground():
    """Leaves in all directions over ground in two colours, three bands."""
    rng = np.random.default_rng(1)
    leaves = [
        square(0.3, direction_from_angles(np.degrees(np.arccos(rng.random())), a), place)
        for a, place in zip(
            rng.uniform(0, 360, 300), rng.uniform([0, 0, 0.5], [4, 4, 3], (300, 3)), strict=True
        )
    ]
    ground = [square(10.0, [0, 0, 1], [x, 2.0, 0.0]) for x in (-3.0, 7.0)]
    mesh = concatenate([*leaves, *ground])
    materials = Materials(
        np.array([[0.05, 0.12, 0.45], [0.1, 0.2, 0.3], [0.2, 0.2, 0.2]]),
        np.array([[0.01, 0.1, 0.43], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        np.r_[np.zeros(600, int), [1, 1, 2, 2]],
    )
    view = View(0.0, 4.0, 8, 8, 0.5)
    diffuse = np.array([0.3, 0.2, 0.1])
    own = camera.photograph(
        camera.build(mesh, materials), view, **SUN, diffuse_share=diffuse, paths_per_pixel=[1024],
        seed=1,
    )  # fmt: skip
    less = by_less(mesh, materials, view, diffuse, paths=1024)
    assert less.mean(axis=(1, 2)) == pytest.approx(own.mean(axis=(1, 2)), rel=0.01)
    assert np.corrcoef(less.ravel(), own.ravel())[0, 1] > 0.995


def test_like_grounds_are_one_and_needles_stay_as_they_are():
    rng = np.random.default_rng(2)
    ground = np.repeat(rng.random((3, 2)), 100, axis=0) + 1e-6 * rng.random((300, 2))
    needle = np.array([[0.05, 0.4]])
    materials = Materials(
        np.concatenate([ground, needle]),
        np.concatenate([np.zeros_like(ground), needle]),
        np.arange(301),
    )
    used = less_camera.few(materials, np.ones(301), seed=1, most=3)
    assert len(used.reflectance) == 4
    shown = used.reflectance[used.of_face]
    assert shown == pytest.approx(materials.reflectance, abs=2e-6)


def test_bark_keeps_its_colour_among_thousands_of_patches_of_ground():
    ground = np.random.default_rng(3).random((300, 2))
    bark = np.array([[0.1, 0.5]])
    opaque = np.concatenate([bark, ground])
    materials = Materials(opaque, np.zeros_like(opaque), np.arange(301))
    area_m2 = np.r_[50.0, np.ones(300)]
    used = less_camera.few(materials, area_m2, seed=1, most=8)
    assert len(used.reflectance) == 9
    assert used.reflectance[used.of_face[0]] == pytest.approx(bark[0])
