import numpy as np
import pytest

from dapple.errors import InputError
from dapple.optics import soil
from dapple.optics.bands import camera_mean
from dapple.optics.cameras import ZHAO, Band, Camera, camera
from dapple.optics.leaf import camera_leaves, leaf_spectra


@pytest.fixture
def vectors(tmp_path):
    """A flat dry soil of 0.5, and water that takes more in the infrared."""
    dry = np.array([np.full(211, 0.5), np.linspace(0, 1, 211), np.zeros(211)])
    np.savetxt(tmp_path / "DryVec.txt", dry)
    np.savetxt(tmp_path / "SMVec.txt", np.linspace(0.1, 1.0, 211)[None])
    return tmp_path


def test_a_flat_band_of_a_straight_line_has_the_value_in_its_middle():
    table_nm = np.arange(400.0, 2501.0, 10.0)
    mean = camera_mean(table_nm, 0.001 * table_nm, ZHAO)
    assert mean == pytest.approx([0.45, 0.56, 0.65, 0.73, 0.84], rel=1e-12)


def test_a_band_with_a_triangular_response_weighs_what_it_sees_most():
    """Of a step at its centre a symmetric band sees a half; of a kink |x| a third of its foot."""
    response = ((500.0, 0.0), (520.0, 2.0), (540.0, 0.0))
    seen = Camera((Band("flat", 520.0, 40.0), Band("peak", 520.0, 40.0, response)))
    table_nm = np.arange(400.0, 701.0, 0.25)
    kink = np.abs(table_nm - 520.0)
    assert camera_mean(table_nm, kink, seen) == pytest.approx([10.0, 20.0 / 3.0], rel=1e-3)
    assert camera_mean(table_nm, np.ones_like(kink), seen) == pytest.approx(1.0)


def test_a_camera_is_read_from_rows_and_a_table_of_responses(tmp_path):
    path = tmp_path / "responses.csv"
    path.write_text("wavelength_nm,green\n540,0\n560,1\n580,0.5\n")
    rows = [("green", 560.0, 32.0), ("nir", 840.0, 52.0)]
    seen = camera(rows, path)
    assert seen.names == ("green", "nir")
    assert seen.bands[0].response == ((540, 0.0), (560, 1.0), (580, 0.5))
    assert seen.bands[1].response == ()
    assert camera(rows).bands[0].response == ()


def test_the_near_infrared_band_is_found_wherever_it_stands():
    assert ZHAO.near_infrared == 4
    assert camera([("a", 850.0, 20.0), ("b", 550.0, 20.0)]).near_infrared == 0
    with pytest.raises(InputError, match="centres at 550 nm; expected a band between 760"):
        _ = camera([("b", 550.0, 20.0)]).near_infrared


def test_of_five_bands_traced_by_threes_the_infrared_ones_are_in_the_second_three():
    """450, 560 and 650 nm are not scattered by leaves; 730 and 840 nm are."""
    assert [ZHAO.is_infrared(first) for first in (0, 3)] == [False, True]


def test_a_spectrum_is_linear_between_its_points_and_even_beyond_them():
    seen = camera([(str(nm), nm, 10.0) for nm in (400.0, 500.0, 525.0, 600.0, 900.0)])
    found = seen.at_centres(((500.0, 0.2), (550.0, 0.4), (600.0, 0.1)))
    assert found == pytest.approx((0.2, 0.2, 0.3, 0.1, 0.1))


@pytest.mark.parametrize("kind", ["gsv", "two soils"])
def test_a_brighter_soil_is_brighter_and_a_wetter_soil_darker_in_proportion(vectors, kind):
    model = soil.choose(ZHAO, vectors if kind == "gsv" else "")
    dark, bright, wet = model(np.array([0.2, 0.4, 0.4]), np.array([0.1, 0.1, 0.7]))
    assert bright == pytest.approx(2 * dark)
    assert (wet < bright).all()
    assert (wet > 0).all()


def test_a_dry_gsv_soil_is_its_first_vector_times_brightness(vectors):
    model = soil.gsv(*soil.read_gsv(vectors), ZHAO)
    assert model(0.3, 0.0)[0] == pytest.approx(np.full(5, 0.15))
    # Water at 450 nm: 0.1 + 0.9 × 50 / 2100
    assert model(0.3, 0.5)[0, 0] == pytest.approx(0.3 * (0.5 - 0.5 * (0.1 + 0.9 * 50 / 2100)))


def test_a_soil_never_leaves_0_to_1(vectors):
    model = soil.gsv(*soil.read_gsv(vectors), ZHAO)
    assert (model(10.0, 0.0) == 1.0).all()
    assert (model(1.0, 50.0) == 0.0).all()


def test_soil_vectors_that_are_missing_or_of_another_length_are_refused(tmp_path):
    with pytest.raises(InputError, match="no file"):
        soil.choose(ZHAO, tmp_path)
    np.savetxt(tmp_path / "DryVec.txt", np.zeros((3, 210)))
    with pytest.raises(InputError, match=r"\(3, 210\); expected \(3, 211\)"):
        soil.choose(ZHAO, tmp_path)


def test_leaves_in_a_camera_are_leaves_in_narrow_bands_averaged():
    reflectance, transmittance = camera_leaves(ZHAO, n=[1.2, 2.4], chlorophyll_ug_cm2=[20.0, 60.0])
    assert reflectance.shape == transmittance.shape == (2, 5)
    narrow, _ = leaf_spectra(np.arange(424.0, 477.0), n=2.4, chlorophyll_ug_cm2=60.0)
    assert reflectance[1, 0] == pytest.approx(narrow[10:43].mean(), rel=2e-3)


def test_leaves_are_bright_and_hardly_absorb_in_the_near_infrared():
    reflectance, transmittance = camera_leaves(ZHAO, chlorophyll_ug_cm2=[10.0, 70.0])
    assert (reflectance + transmittance)[:, 4] == pytest.approx(0.95, abs=0.04)
    # Chlorophyll tells in green and red edge, and not at all at 840 nm.
    assert (reflectance[0] > 1.2 * reflectance[1])[[1, 3]].all()
    assert reflectance[0, 4] == pytest.approx(reflectance[1, 4], rel=1e-3)


def test_leaves_beyond_the_range_of_prospect_are_refused():
    with pytest.raises(InputError, match="brown"):
        camera_leaves(ZHAO, brown=[0.1, 9.0])
    with pytest.raises(InputError, match="chlorophyl;"):
        camera_leaves(ZHAO, chlorophyl=40.0)
