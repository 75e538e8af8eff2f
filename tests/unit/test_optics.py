import numpy as np
import pytest

from dapple.errors import InputError
from dapple.optics import surface_spectra
from dapple.optics.bands import band_edges, band_mean, band_width, par_bands, photon_flux
from dapple.optics.leaf import leaf_spectra
from dapple.scene import scene_optics

BANDS = par_bands()


def test_bands_cover_the_par_range_without_gap_or_overlap():
    assert len(BANDS) == 61
    assert band_edges(BANDS)[[0, 1, -2, -1]] == pytest.approx([400.0, 402.5, 697.5, 700.0])
    assert band_width(BANDS).sum() == pytest.approx(300.0)


def test_the_mean_of_a_straight_line_is_its_value_in_the_middle_of_the_band():
    table_nm = np.array([390.0, 433.3, 555.5, 710.0])
    edges = band_edges(BANDS)
    middle = 0.5 * (edges[1:] + edges[:-1])
    line = band_mean(table_nm, 0.1 + 0.001 * table_nm, BANDS)
    assert line == pytest.approx(0.1 + 0.001 * middle, rel=1e-12)


def test_bands_together_keep_the_integral_of_a_spectrum_with_a_kink():
    table_nm, values = np.array([400.0, 551.0, 700.0]), np.array([0.0, 1.0, 0.0])
    total = (band_mean(table_nm, values, BANDS) * band_width(BANDS)).sum()
    assert total == pytest.approx(150.0, rel=1e-12)


def test_one_watt_of_555_nm_is_4_64_micromoles_of_photons():
    # 555e-9 m × 8.35935e6 µmol J⁻¹ m⁻¹, the reciprocal of h c N_A = 0.119626566 J m mol⁻¹
    assert photon_flux(1.0, 555.0) == pytest.approx(555e-9 / 0.119626566 * 1e6, rel=1e-8)


def test_a_leaf_never_gives_back_more_light_than_it_gets():
    for n in (1.0, 2.5, 4.0):
        for chlorophyll in (0.0, 45.0, 150.0):
            rho, tau = leaf_spectra(BANDS, n=n, chlorophyll_ug_cm2=chlorophyll)
            assert (rho > 0).all()
            assert (tau >= 0).all()
            assert (rho + tau < 1).all()


def test_a_green_leaf_is_brightest_in_the_green_and_dark_in_blue_and_red():
    rho, tau = leaf_spectra(BANDS)
    blue, green, red = (int(np.flatnonzero(nm == BANDS)[0]) for nm in (450, 550, 675))
    assert rho[green] > 1.5 * max(rho[blue], rho[red])
    assert max(tau[blue], tau[red]) < 0.02 < tau[green]


def test_more_chlorophyll_means_a_darker_leaf():
    pale, dark = (sum(leaf_spectra(BANDS, chlorophyll_ug_cm2=c)) for c in (20.0, 60.0))
    assert (dark <= pale).all()
    assert dark.mean() < 0.8 * pale.mean()


def test_a_leaf_outside_the_range_of_prospect_is_refused():
    with pytest.raises(InputError, match=r"water_cm: found 12\.0; expected 0\.0 to 0\.1"):
        leaf_spectra(BANDS, water_cm=12.0)
    with pytest.raises(InputError, match="anthocyanin"):
        leaf_spectra(BANDS, prospect_version="5", anthocyanin_ug_cm2=1.0)
    with pytest.raises(InputError, match="prospect_version"):
        leaf_spectra(BANDS, prospect_version="4")


def test_a_surface_is_a_number_a_table_or_a_file(tmp_path):
    path = tmp_path / "moss.csv"
    path.write_text("wavelength_nm,front_reflectance,transmittance\n700,0.4,0\n390,0.09,0\n")
    table = {"wavelength_nm": (390.0, 700.0), "reflectance": (0.09, 0.4)}
    expected = surface_spectra.reflectance(table, BANDS)
    assert expected[20] == pytest.approx(0.2)  # 500 nm: 0.09 + 110 × 0.001
    assert surface_spectra.reflectance(path, BANDS) == pytest.approx(expected)
    with_path = {"wavelength_nm": (400.0, 700.0), "reflectance": (0.9, 0.9), "path": path}
    assert surface_spectra.reflectance(with_path, BANDS) == pytest.approx(expected)
    assert surface_spectra.reflectance(0.2, BANDS) == pytest.approx(np.full(61, 0.2))


@pytest.mark.parametrize(
    ("wavelengths", "values", "message"),
    [
        ((400, 700), (5, 12), "percent"),
        ((450, 700), (0.1, 0.1), "450 to 700 nm"),
        ((400, 550, 550, 700), (0.1, 0.2, 0.3, 0.1), "each wavelength once"),
        ((400, 700), (0.1, float("nan")), "nan at 700 nm"),
        ((400, 550, 700), (0.1, 0.1), "3 wavelengths and 2 reflectances"),
    ],
)
def test_an_impossible_surface_is_refused(wavelengths, values, message):
    with pytest.raises(InputError, match=message):
        surface_spectra.reflectance({"wavelength_nm": wavelengths, "reflectance": values}, BANDS)


def test_a_spectrum_file_that_is_missing_or_foreign_is_refused(tmp_path):
    with pytest.raises(InputError, match="no file"):
        surface_spectra.read(tmp_path / "none.csv")
    (tmp_path / "foreign.csv").write_text("nm,r\n400,0.1\n")
    with pytest.raises(InputError, match="columns nm, r; expected `wavelength_nm`"):
        surface_spectra.read(tmp_path / "foreign.csv")


def test_the_optics_of_a_scene_have_one_value_per_band_and_kind():
    optics = scene_optics.from_spectra(leaf={"n": 1.8}, bark=0.2)
    of_leaf = optics.reflectance["leaf"], optics.transmittance["leaf"]
    for values in (*of_leaf, optics.reflectance["ground"]):
        assert values.shape == (61,)
        assert ((values > 0) & (values < 0.3)).all()
    assert optics.reflectance["wood"] == pytest.approx(0.2)
