import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.retrieval import prosail
from dapple.retrieval.spectra import Spectra

NO_SKY = np.zeros(5)


def spectra(leaf_reflectance, leaf_transmittance, soil):
    return Spectra(*(np.full((1, 5), x) for x in (leaf_reflectance, leaf_transmittance, soil)))


def test_without_plants_there_is_soil():
    found = prosail.images(
        np.zeros((1, 1)), spectra(0.4, 0.4, 0.23), sun_zenith_deg=40.0, diffuse_share=NO_SKY
    )
    assert found.shape == (1, 1, 5)
    assert found == pytest.approx(0.23)


def test_black_leaves_leave_soil_seen_and_lit_through_gaps():
    # Spherical leaves: a beam at zenith angle t passes with exp(-0.5 L / cos t); the small leaves
    # of this hot spot parameter see sun and eye apart.
    zenith, index, soil = 58.0, 1.0, 0.3
    found = prosail.images(
        np.full((1, 1), index), spectra(0.0, 0.0, soil), sun_zenith_deg=zenith,
        diffuse_share=NO_SKY, hot_spot=1e-6,
    )  # fmt: skip
    gaps = np.exp(-0.5 * index * (1 + 1 / np.cos(np.radians(zenith))))
    assert found == pytest.approx(soil * gaps, rel=0.02)


def test_a_dense_canopy_hides_the_soil_and_light_is_not_made():
    dense = np.full((1, 1), 30.0)
    dark, bright = (
        prosail.images(dense, spectra(0.5, 0.49, soil), sun_zenith_deg=30.0, diffuse_share=NO_SKY)
        for soil in (0.0, 0.9)
    )
    assert dark == pytest.approx(bright, abs=0.03)
    assert (bright < 1.0).all()


def test_light_from_sun_and_sky_adds_up():
    pixels, one = np.array([[0.5, 2.0]]), spectra(0.45, 0.4, 0.2)
    sun, sky, half = (
        prosail.images(pixels, one, sun_zenith_deg=58.0, diffuse_share=np.full(5, share))
        for share in (0.0, 1.0, 0.5)
    )
    assert half == pytest.approx(0.5 * (sun + sky), rel=1e-6)
    assert not np.allclose(sun, sky, rtol=0.01)


def test_every_cell_and_combination_is_its_own():
    both = Spectra(*(np.array([[x] * 5, [y] * 5]) for x, y in ((0.4, 0.1), (0.4, 0.1), (0.2, 0.1))))
    found = prosail.images(
        np.array([[1.0, 3.0]]), both, sun_zenith_deg=38.53, diffuse_share=np.full(5, 0.2)
    )
    single = prosail.images(
        np.array([[3.0]]), spectra(0.1, 0.1, 0.1), sun_zenith_deg=38.53,
        diffuse_share=np.full(5, 0.2),
    )  # fmt: skip
    assert found.shape == (2, 2, 5)
    assert found[1, 1] == pytest.approx(single[0, 0])


def test_the_area_of_facets_is_counted_in_their_cells():
    facet = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])  # upright, 1 m²
    corners = facet + np.array([[[1.0, 5.0, 3.0]], [[4.0, 1.0, 9.0]], [[40.0, 1.0, 9.0]]])
    faces = np.arange(9, dtype=np.int32).reshape(3, 3)
    leaves = Mesh(corners.reshape(-1, 3), faces, np.arange(3, dtype=np.int32))
    found = prosail.plant_area_index(leaves, left_m=0.0, top_m=6.0, cell_m=3.0, shape=(2, 2))
    assert found == pytest.approx(np.array([[1 / 9, 0.0], [0.0, 1 / 9]]))


def test_night_and_negative_plants_are_refused():
    one = spectra(0.4, 0.4, 0.2)
    with pytest.raises(InputError, match="sun_zenith_deg"):
        prosail.images(np.ones((1, 1)), one, sun_zenith_deg=95.0, diffuse_share=NO_SKY)
    with pytest.raises(InputError, match="plant area index"):
        prosail.images(np.full((1, 1), -1.0), one, sun_zenith_deg=40.0, diffuse_share=NO_SKY)
