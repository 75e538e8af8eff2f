"""What the program for LESS 3 adds to LESS: a sun with a disc, and sensors that are round."""

import numpy as np
import pytest
import xarray as xr

pytest.importorskip("less", reason="less3d 3.0.0 is not installed")

from dapple.light import less_engine, less_run
from dapple.scene.scene_optics import Optics

DIAMETER_DEG = 0.53


def ways(suns):
    """Unit vectors to suns, x east and y north."""
    zenith, azimuth = np.radians(suns).T
    flat = np.sin(zenith)[:, None] * np.stack([np.sin(azimuth), np.cos(azimuth)], axis=1)
    return np.column_stack([flat, np.cos(zenith)])


@pytest.mark.parametrize("zenith_deg", [0.1, 40.0, 89.9])
def test_suns_lie_evenly_on_the_disc(zenith_deg):
    """Their mean is its middle, and they lie as far from it as the points of a disc do."""
    found = ways(less_run.suns(zenith_deg, 200.0, DIAMETER_DEG, 4000, [1]))
    middle = ways([(zenith_deg, 200.0)])[0]
    radius = np.sin(np.radians(DIAMETER_DEG / 2))
    away = found - (found @ middle)[:, None] * middle
    distance = np.linalg.norm(away, axis=1) / radius
    assert distance.max() <= 1 + 1e-9
    assert (distance**2).mean() == pytest.approx(1 / 2, rel=0.01)
    assert (distance < 0.5).mean() == pytest.approx(1 / 4, abs=0.01)
    assert np.abs(away.mean(axis=0)).max() < 0.02 * radius
    across = np.cross(middle, [0.3, 0.9, 0.2])
    assert ((away @ across) ** 2).mean() == pytest.approx(
        (across @ across) * radius**2 / 4, rel=0.05
    )


def test_a_sun_without_a_disc_is_one_point_and_seeds_turn_the_others():
    assert less_run.suns(40.0, 200.0, 0.0, 16, [1]) == [(40.0, 200.0)]
    one, same, other = (less_run.suns(40.0, 200.0, DIAMETER_DEG, 16, [k]) for k in (1, 1, 2))
    assert one == same
    assert one != other


def test_pixels_of_a_square_image_count_by_their_part_of_the_disc():
    weight = less_run.in_disc().reshape(less_run.PIXELS, less_run.PIXELS)
    assert weight.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(weight, weight.T)
    np.testing.assert_allclose(weight, weight[::-1])
    whole = 1 / (np.pi / 4) / less_run.PIXELS**2
    assert weight[3, 3] == pytest.approx(whole, rel=1e-3)
    # The edge of the disc meets the outermost pixels alone in their inner corner.
    assert weight[0, 0] == 0.0
    assert 0.0 < weight[0, 3] < whole


def test_the_mean_of_pixels_errs_by_their_errors_together():
    pixels = np.full(less_run.PIXELS**2, 3.0)
    mean, variance = less_run.mean_and_variance(pixels, np.full(pixels.shape, 0.1))
    assert mean == pytest.approx(3.0)
    inside = np.pi / 4 * less_run.PIXELS**2
    assert variance == pytest.approx(0.1**2 / inside, rel=0.1)


def test_light_of_bands_between_those_that_are_told_lies_between_them():
    sky = less_run.Sky(
        [400.0, 700.0], np.array([1.0, 4.0]), np.array([2.0, 2.0]), np.ones((16, 32))
    )
    beam, level, _, radiance = sky.surface_illumination(None, np.array([400.0, 500.0, 700.0]))
    assert beam == pytest.approx([1.0, 2.0, 4.0])
    assert level == pytest.approx([2.0, 2.0, 2.0])
    assert radiance is None  # an even sky is LESS' own
    uneven = np.ones((16, 32))
    uneven[0] = 3.0
    sky = less_run.Sky([400.0, 700.0], np.ones(2), np.array([2.0, 4.0]), uneven)
    radiance = sky.surface_illumination(None, np.array([550.0]))[3]
    assert radiance.shape == (1, 16, 32)
    assert radiance[0, 0] == pytest.approx(9.0)
    assert radiance[0, 1:] == pytest.approx(3.0)


def test_bands_in_groups_keep_the_light_in_the_order_of_their_wavelengths():
    """LESS follows three groups in place of all bands; their light is that of all."""
    wavelength_nm = np.linspace(450.0, 690.0, 7)
    leaf = np.array([0.05, 0.06, 0.2, 0.22, 0.21, 0.06, 0.05])  # dark in blue and red
    optics = Optics.of_tree(wavelength_nm, leaf, 0.5 * leaf, 0.3 * leaf, 0.1 + 0.0 * leaf)
    beam, diffuse = np.arange(14.0).reshape(2, 7), np.full((2, 7), 3.0)
    sky = xr.Dataset(
        dict(zip(less_engine.FLUXES, ((("time", "band"), x) for x in (beam, diffuse)), strict=True))
    )
    fluxes, grouped = less_engine.in_groups(sky, optics, 2)
    for name, whole in zip(less_engine.FLUXES, (beam, diffuse), strict=True):
        assert fluxes[name].sum("band").to_numpy() == pytest.approx(whole.sum(axis=1))
    assert (np.diff(grouped.wavelength_nm) > 0).all()
    dark, green = np.sort(grouped.reflectance["leaf"])
    assert dark < 0.07
    assert green > 0.2
    assert less_engine.in_groups(sky, optics, 7) == (sky, optics)
