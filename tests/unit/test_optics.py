import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.optics import default_spectra, spectrum_table, surface_spectra
from dapple.optics.bands import band_edges, band_mean, band_width, par_bands, photon_flux
from dapple.optics.leaf import leaf_spectra
from dapple.scene import scene_optics

BANDS = par_bands()
PAR = (400.0, 700.0)
MEASURED = Path(os.environ.get("DAPPLE_DATA_DIR", "../shared/data")) / "spectra"


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


@pytest.mark.parametrize("pigment", ["chlorophyll", "carotenoids", "anthocyanin"])
def test_a_leaf_may_lack_a_pigment_and_then_absorbs_less(pigment):
    without, with_it = (
        sum(leaf_spectra(BANDS, **{f"{pigment}_ug_cm2": content})) for content in (0.0, 20.0)
    )
    assert (without >= with_it - 1e-12).all()
    assert (without > with_it + 0.05).any()


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


def spectrum(tmp_path, rows, header="wavelength_nm,reflectance"):
    path = tmp_path / "spectrum.csv"
    path.write_text(header + "\n" + "\n".join(rows) + "\n")
    return path


def steady(value, low=350, high=2500, step=1):
    return [f"{nm},{value}" for nm in range(low, high + 1, step)]


def test_a_spectrum_file_that_is_missing_or_foreign_is_refused(tmp_path):
    with pytest.raises(InputError, match="no file"):
        spectrum_table.read(tmp_path / "none.csv", PAR)
    path = spectrum(tmp_path, ["400,0.1"], "when,what")
    with pytest.raises(InputError, match=r"columns when, what.*`optics.wavelength_column`"):
        spectrum_table.read(path, PAR)


@pytest.mark.parametrize(
    ("rows", "header"),
    [
        (steady(0.2), "wavelength_nm,reflectance"),
        (steady(20), "wavelength [nm],reflectance [%]"),
        (steady("20 %"), "wavelength,reflectance"),
        ([row.replace(",", " nm,") for row in steady(0.2)], "wavelength,reflectance"),
        ([f"{nm / 1000},0.2" for nm in range(350, 2501)], "wavelength_um,reflectance"),
        ([f"{nm};0,2" for nm in range(350, 2501)], "Wavelength;Reflectance"),
    ],
)
def test_units_of_a_spectrum_are_read_from_header_and_cells(tmp_path, rows, header):
    read = spectrum_table.read(spectrum(tmp_path, rows, header), PAR)
    assert read.wavelength_nm[[0, -1]] == pytest.approx([350, 2500])
    assert read.values["reflectance"] == pytest.approx(0.2)
    assert not read.findings


def test_percent_without_a_word_is_recognised_and_said(tmp_path):
    read = spectrum_table.read(spectrum(tmp_path, steady(20)), PAR)
    assert read.values["reflectance"] == pytest.approx(0.2)
    assert "Taken as percent" in read.findings[0].remedy


def test_noise_outside_the_used_range_is_named_and_not_refused(tmp_path):
    rows = [row if not 1800 <= int(row[:4].strip(",")) <= 1950 else f"{row[:4]},-0.3"
            for row in steady(0.2)]  # fmt: skip
    read = spectrum_table.read(spectrum(tmp_path, rows), PAR)
    (found,) = read.findings
    assert found.level == "note"
    assert "between 1800 and 1950 nm, which is not used" in found.found


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (steady(0.2, low=450), "450 to 2500 nm; expected 400 to 700 nm"),
        ([*steady(0.2), "500,0.3"], "500 nm twice"),
        (steady(-0.5), "reflectance -0.5 at 400 nm"),
        ([f"{nm / 1000},0.2" for nm in range(350, 900)], "wavelength_um"),
    ],
)
def test_a_spectrum_that_cannot_be_used_is_refused(tmp_path, rows, message):
    with pytest.raises(InputError, match=message):
        spectrum_table.read(spectrum(tmp_path, rows), PAR)


def test_a_little_noise_is_cut_and_a_gap_is_drawn_over_and_both_are_said(tmp_path):
    rows = [row for row in steady(0.2) if not 500 < int(row.split(",")[0]) < 560]
    rows[60] = "410,-0.004"
    read = spectrum_table.read(spectrum(tmp_path, rows), PAR)
    assert read.values["reflectance"].min() == 0.0
    said = " ".join(map(str, read.findings))
    assert "a little outside 0 to 1" in said
    assert "no value between 500 and 560 nm" in said


def test_a_measured_leaf_takes_the_place_of_prospect(tmp_path):
    rows = [f"{nm},0.1,{0.05 if nm < 500 else 0.15}" for nm in range(400, 701)]
    path = spectrum(tmp_path, rows, "wavelength_nm,front_reflectance,transmittance")
    optics = scene_optics.from_spectra(leaf={"path": path, "chlorophyll_ug_cm2": 45.0})
    assert optics.reflectance["leaf"] == pytest.approx(0.1)
    assert optics.transmittance["leaf"][[0, -1]] == pytest.approx([0.05, 0.15])


def test_a_measured_leaf_gives_back_no_more_light_than_it_gets(tmp_path):
    rows = [f"{nm},0.6,0.5" for nm in range(400, 701)]
    path = spectrum(tmp_path, rows, "wavelength_nm,reflectance,transmittance")
    with pytest.raises(InputError, match=r"reflectance 0\.6 and transmittance 0\.5 at 400 nm"):
        scene_optics.from_spectra(leaf={"path": path})
    with pytest.raises(InputError, match=r"`optics.leaf.transmittance_column`"):
        scene_optics.from_spectra(leaf={"path": spectrum(tmp_path, steady(0.2))})


def test_the_optics_of_a_scene_have_one_value_per_band_and_kind():
    optics = scene_optics.from_spectra(leaf={"n": 1.8}, bark=0.2)
    of_leaf = optics.reflectance["leaf"], optics.transmittance["leaf"]
    for values in (*of_leaf, optics.reflectance["ground"]):
        assert values.shape == (61,)
        assert ((values > 0) & (values < 0.3)).all()
    assert optics.reflectance["wood"] == pytest.approx(0.2)


def test_bark_is_the_mean_of_two_measured_branches():
    paths = [MEASURED / f"spectrum_{tree}_branch.csv" for tree in ("birch", "larch")]
    if not all(path.is_file() for path in paths):
        pytest.skip(f"no {MEASURED}: set DAPPLE_DATA_DIR to the folder of the real data")
    known = default_spectra.BARK["wavelength_nm"]
    columns = ("wavelength_nm", "front_reflectance")
    tables = [pd.read_csv(path)[list(columns)].to_numpy().T for path in paths]
    mean = np.mean([np.interp(known, *table) for table in tables], axis=0)
    assert default_spectra.BARK["reflectance"] == pytest.approx(mean, abs=0.0006)
    # 13 points do for all 61 bands: nowhere between them is the mean of a band far off
    fine = np.mean([band_mean(*table, BANDS) for table in tables], axis=0)
    assert band_mean(*map(np.array, default_spectra.BARK.values()), BANDS) == pytest.approx(
        fine, abs=0.02
    )


def test_the_default_meadow_is_what_prosail_computes_for_mown_grass():
    import prosail

    leaf = default_spectra.LEAF
    albedo = prosail.run_prosail(
        leaf["n"], leaf["chlorophyll_ug_cm2"], leaf["carotenoids_ug_cm2"], leaf["brown"],
        leaf["water_cm"], leaf["dry_matter_g_cm2"], 1.0, 57.3, 0.01, 40.0, 0.0, 0.0,
        ant=leaf["anthocyanin_ug_cm2"], prospect_version="D", typelidf=2, rsoil=1.0, psoil=0.5,
        factor="BHR",
    )  # fmt: skip
    at = np.array(default_spectra.MEADOW["wavelength_nm"], int) - 400
    np.testing.assert_allclose(default_spectra.MEADOW["reflectance"], albedo[at], atol=6e-4)
