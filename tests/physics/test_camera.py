"""Photographs of worlds whose reflectance is known in closed form."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats.meshes import Mesh, concatenate
from dapple.virtual import camera
from dapple.virtual.camera import View
from dapple.virtual.plot_optics import Materials

SUN = {"sun_zenith_deg": 58.0, "sun_azimuth_deg": 266.32}
FAR_M = 2000.0
RHO = np.array([0.05, 0.1, 0.08, 0.3, 0.45])
TAU = np.array([0.03, 0.08, 0.05, 0.25, 0.42])
GROUND = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
DARK = np.zeros(5)


def plate(z_m, low=(-FAR_M, -FAR_M), high=(FAR_M, FAR_M), slope_east=0.0):
    (x0, y0), (x1, y1) = low, high
    corners = np.array([[x0, y0, z_m], [x1, y0, z_m], [x1, y1, z_m], [x0, y1, z_m]], float)
    corners[:, 2] += slope_east * corners[:, 0]
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def photo(meshes, optics, *, diffuse=0.0, paths=8192, seed=1, sun=SUN, size_m=(4.0, 4.0)):
    """Picture of plates, each with its reflectance and transmittance."""
    reflectance, transmittance = (np.array(part) for part in zip(*optics, strict=True))
    of_face = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    scene = camera.build(concatenate(meshes), Materials(reflectance, transmittance, of_face))
    return camera.photograph(
        scene, View.over(size_m, 1.0), **sun, diffuse_share=np.full(5, diffuse),
        paths_per_pixel=(paths, paths), seed=seed,
    )  # fmt: skip


@pytest.mark.parametrize("diffuse", [0.0, 0.3, 1.0])
def test_white_ground_reflects_one(diffuse):
    image = photo([plate(0.0)], [(np.ones(5), DARK)], diffuse=diffuse)
    assert image.shape == (5, 4, 4)
    np.testing.assert_allclose(image.mean(axis=(1, 2)), 1.0, rtol=0.01)


@pytest.mark.parametrize("sun_zenith_deg", [0.0, 38.53, 75.0])
def test_the_suns_height_does_not_matter_to_level_lambertian_ground(sun_zenith_deg):
    sun = {"sun_zenith_deg": sun_zenith_deg, "sun_azimuth_deg": 10.0}
    image = photo([plate(0.0)], [(GROUND, DARK)], sun=sun)
    np.testing.assert_allclose(image.mean(axis=(1, 2)), GROUND, rtol=0.01)


@pytest.mark.parametrize("diffuse", [0.0, 1.0])
def test_a_leaf_layer_over_ground_follows_the_adding_of_layers(diffuse):
    leaf, ground = plate(1.0), plate(0.0)
    image = photo([leaf, ground], [(RHO, TAU), (GROUND, DARK)], diffuse=diffuse)
    expected = RHO + TAU**2 * GROUND / (1 - RHO * GROUND)
    np.testing.assert_allclose(image.mean(axis=(1, 2)), expected, rtol=0.02)


def test_two_leaf_layers_over_black_ground_follow_the_adding_of_layers():
    image = photo([plate(2.0), plate(1.0)], [(RHO, TAU), (RHO, TAU)])
    expected = RHO + TAU**2 * RHO / (1 - RHO**2)
    np.testing.assert_allclose(image.mean(axis=(1, 2)), expected, rtol=0.02)


def test_a_slope_is_bright_by_the_cosine_of_its_incidence():
    sun = {"sun_zenith_deg": 40.0, "sun_azimuth_deg": 90.0}
    slope = np.radians(20.0)
    rising = plate(0.0, slope_east=np.tan(slope))
    image = photo([rising], [(GROUND, DARK)], sun=sun)
    # A plane that rises to the east turns away from a sun in the east.
    expected = GROUND * np.cos(np.radians(40.0) + slope) / np.cos(np.radians(40.0))
    np.testing.assert_allclose(image.mean(axis=(1, 2)), expected, rtol=0.01)


def test_materials_stay_where_they_are_and_north_is_up():
    north = plate(0.0, low=(-FAR_M, 3.0))
    south_west, south_east = plate(0.0, high=(2.0, 3.0)), plate(0.0, (2.0, -FAR_M), (FAR_M, 3.0))
    colours = [(GROUND * share, DARK) for share in (1.0, 0.5, 0.2)]
    image = photo([north, south_west, south_east], colours)
    np.testing.assert_allclose(image[:, 0], np.repeat(GROUND[:, None], 4, 1), rtol=0.02)
    np.testing.assert_allclose(image[:, 1:, :2].mean(axis=(1, 2)), 0.5 * GROUND, rtol=0.02)
    np.testing.assert_allclose(image[:, 1:, 2:].mean(axis=(1, 2)), 0.2 * GROUND, rtol=0.02)


def test_shadows_fall_away_from_the_sun_by_its_tangent():
    sun = {"sun_zenith_deg": 45.0, "sun_azimuth_deg": 270.0}
    roof = plate(4.0, (0.0, 1.0), (1.0, 3.0))
    image = photo([roof, plate(0.0)], [(DARK, DARK), (GROUND, DARK)], sun=sun, size_m=(8.0, 4.0))
    lit = image[4] / GROUND[4]
    assert lit[1:3, 4].max() < 0.01  # 4 m high, sun in the west: shadow 4 m to the east
    assert lit[1:3, 0].max() < 0.01  # the black roof itself
    np.testing.assert_allclose(lit[1:3, [1, 2, 3, 5, 6, 7]], 1.0, rtol=0.02)
    np.testing.assert_allclose(lit[[0, 3]], 1.0, rtol=0.02)


def test_the_seed_makes_the_image():
    one, same, other = (
        photo([plate(1.0), plate(0.0)], [(RHO, TAU), (GROUND, DARK)], seed=seed, paths=16)
        for seed in (1, 1, 2)
    )
    assert one.tobytes() == same.tobytes()
    assert one.tobytes() != other.tobytes()


def test_noise_grows_with_the_signal():
    image = np.stack([np.zeros((200, 200)), np.full((200, 200), 0.5)])
    noise = camera.with_noise(image, relative=0.02, absolute=0.001, seed=1) - image
    assert noise[0].std() == pytest.approx(0.001, rel=0.02)
    assert noise[1].std() == pytest.approx(np.hypot(0.01, 0.001), rel=0.02)


def test_the_camera_sees_the_whole_pixels_of_a_plot():
    assert vars(View.over((20.0, 30.0), 0.026)) == {
        "left_m": 0.0, "top_m": 30.0, "rows": 1153, "columns": 769, "pixel_m": 0.026,
    }  # fmt: skip
    with pytest.raises(InputError, match="pixels smaller"):
        View.over((0.5, 3.0), 1.0)


def test_leaves_that_make_light_are_refused():
    with pytest.raises(InputError, match="shares of light"):
        photo([plate(0.0)], [(np.full(5, 0.7), np.full(5, 0.5))])
