import numpy as np
import pandas as pd
import pvlib
import pytest

from dapple.clock import label
from dapple.errors import InputError
from dapple.formats import netcdf as files
from dapple.optics.bands import par_bands
from dapple.scene import scene_optics
from dapple.sky import sky_radiance, sun
from dapple.sky.conditions import Conditions, Ways
from dapple.sky.models import perez
from dapple.sky.patches import SUBDIVISIONS, patches
from dapple.sky.spectrum import par_spectrum
from dapple.times import parse, time_range, utc

FREIBURG = sun.Site(48.0009, 7.8003, 230.0)
AFTERNOON = time_range("2023-08-10 12:10", "2023-08-10 18:50", 10, "Europe/Berlin")
NIGHT = time_range("2023-08-10 22:00", "2023-08-11 02:00", 60, "UTC")


def radiation_table(tmp_path, text):
    path = tmp_path / "radiation.csv"
    path.write_text("time_utc,global_W_m2,diffuse_W_m2\n" + text)
    return path


def day(model="perez"):
    times = time_range("2023-08-10 03:00", "2023-08-10 21:00", 30, "UTC")
    return sky_radiance.sky_dataset(times, FREIBURG, sun.clear_sky(times, FREIBURG), model=model)


# --- time ---------------------------------------------------------------------------------


def test_naive_times_are_an_error_that_says_so():
    with pytest.raises(InputError, match="naive timestamp"):
        sun.position(pd.date_range("2023-08-10", periods=2, freq="h"), 48.0, 7.8)


def test_an_unknown_time_zone_is_an_error_that_names_it():
    with pytest.raises(InputError, match="'Europe/Freiburg'"):
        time_range("2023-08-10 10:00", "2023-08-10 11:00", 10, "Europe/Freiburg")


def test_the_clock_in_freiburg_is_two_hours_ahead_of_utc_in_august():
    assert AFTERNOON[0] == pd.Timestamp("2023-08-10 10:10", tz="UTC")
    assert len(AFTERNOON) == 41


def test_a_date_that_may_be_day_first_or_month_first_is_not_guessed():
    with pytest.raises(InputError, match="ISO 8601"):
        parse(pd.Series(["10/8/2023 12:00"], name="time_utc"), "table")


def test_a_file_is_named_after_its_time_in_utc():
    assert label(AFTERNOON[0].tz_convert("Europe/Berlin")) == "20230810T101000Z"


def test_a_range_of_times_must_run_forwards():
    for end, step in (("2023-08-10 09:00", 10), ("2023-08-10 11:00", 0)):
        with pytest.raises(InputError, match="an end after the start"):
            time_range("2023-08-10 10:00", end, step, "UTC")


def test_an_offset_in_the_text_wins_over_the_zone_of_the_table():
    column = pd.Series(["2023-08-10T12:00:00+02:00", "2023-08-10T11:00:00Z"], name="time")
    assert list(parse(column, "table").hour) == [10, 11]


def test_an_hour_that_the_clock_ran_twice_is_ambiguous():
    with pytest.raises(InputError, match="exist once in Europe/Berlin"):
        parse(pd.Series(["2023-10-29 02:30"], name="time"), "table", "Europe/Berlin")


# --- sun ----------------------------------------------------------------------------------


def test_the_sun_stands_where_the_worked_example_of_reda_and_andreas_has_it():
    # Reda and Andreas (2004), table A5.1: zenith 50.11162°, azimuth 194.34024°
    time = pd.DatetimeIndex(["2003-10-17 12:30:30-07:00"])
    where = sun.position(time, 39.742476, -105.1786, 1830.14, temperature_c=11.0).iloc[0]
    assert where["sun_zenith_deg"] == pytest.approx(50.11162, abs=5e-4)
    assert where["sun_azimuth_deg"] == pytest.approx(194.34024, abs=5e-4)


def test_noon_comes_late_by_longitude_and_the_equation_of_time():
    # On 10 August the sun is 5.4 min behind the clock (Spencer 1971); 7.8003° east is 31.2 min.
    times = time_range("2023-08-10 11:20", "2023-08-10 12:00", 0.1, "UTC")
    azimuth = sun.position(times, 48.0009, 7.8003, 230.0)["sun_azimuth_deg"]
    noon = times[int(np.abs(azimuth - 180).argmin())]
    expected = pd.Timestamp("2023-08-10 12:00", tz="UTC") + pd.Timedelta(minutes=5.4 - 4 * 7.8003)
    assert abs((noon - expected).total_seconds()) < 20


def test_the_noon_height_of_the_sun_is_latitude_minus_declination():
    # Declination at the June solstice: the obliquity of the ecliptic, 23.44°.
    times = time_range("2023-06-21 11:00", "2023-06-21 12:00", 1, "UTC")
    zenith = sun.position(times, 48.0, 7.8, 0.0)["sun_zenith_deg"].min()
    assert zenith == pytest.approx(48.0 - 23.44, abs=0.02)


def test_refraction_lifts_the_setting_sun_by_its_own_diameter():
    # Bennett (1982): 33.2 arc minutes at an apparent altitude of 0.1°.
    times = time_range("2023-08-10 18:00", "2023-08-10 20:00", 1, "UTC")
    seen = sun.position(times, 48.0009, 7.8003, 0.0)["sun_zenith_deg"]
    true = pvlib.solarposition.get_solarposition(times, 48.0009, 7.8003, altitude=0.0)["zenith"]
    low = int(np.abs(seen - 89.9).argmin())
    assert true.iloc[low] - seen.iloc[low] == pytest.approx(33.2 / 60, abs=0.03)


# --- broadband radiation --------------------------------------------------------------------


def test_a_clear_august_noon_in_freiburg_gives_about_850_watts():
    # The weather station read 856 (global) and 101 (diffuse) W m⁻² at 11:50 UTC on that day.
    noon = sun.clear_sky(time_range("2023-08-10 11:30", "2023-08-10 11:30", 1, "UTC"), FREIBURG)
    assert noon["global_w_m2"].iloc[0] == pytest.approx(856, rel=0.03)
    assert noon["diffuse_w_m2"].iloc[0] == pytest.approx(101, rel=0.15)


def test_haze_turns_direct_light_into_diffuse_light():
    clear, hazy = (sun.clear_sky(AFTERNOON, FREIBURG, linke_turbidity=tl) for tl in (2.0, 5.0))
    assert (hazy["diffuse_w_m2"] > clear["diffuse_w_m2"]).all()
    assert (hazy["global_w_m2"] < clear["global_w_m2"]).all()


def test_the_turbidity_climatology_is_hazier_in_summer_than_in_winter():
    summer, winter = (
        sun._monthly_turbidity(pd.DatetimeIndex([day], tz="UTC"), FREIBURG)[0]
        for day in ("2023-07-15", "2023-12-15")
    )
    assert 2 < winter < summer < 6


def test_at_night_there_is_no_light_and_no_error():
    radiation = sun.clear_sky(NIGHT, FREIBURG)
    dataset = sky_radiance.sky_dataset(NIGHT, FREIBURG, radiation, model="perez")
    assert (radiation.to_numpy() == 0).all()
    for name in (
        "beam_normal_umol_m2_s",
        "diffuse_horizontal_umol_m2_s",
        "sky_coefficients",
        "ghi_w_m2",
    ):
        assert (dataset[name].to_numpy() == 0).all()
    assert (dataset["sun_zenith_deg"] > 90).all()


def test_a_beam_is_never_stronger_than_outside_the_atmosphere_and_global_is_kept():
    radiation = pd.DataFrame({"global_w_m2": [80.0, 500.0], "diffuse_w_m2": [30.0, 100.0]})
    zenith = np.array([89.0, 60.0])
    beam, diffuse = sun.direct_normal(radiation, zenith, np.array([1330.0, 1330.0]))
    assert beam == pytest.approx([1330.0, 800.0])
    assert beam * np.cos(np.radians(zenith)) + diffuse == pytest.approx([80.0, 500.0])


# --- PAR spectrum ---------------------------------------------------------------------------


def spectrum(beam_w, diffuse_w, wavelength_nm):
    zenith = np.array([40.0])
    return par_spectrum(
        AFTERNOON[:1], zenith, np.array([beam_w]), np.array([diffuse_w]), FREIBURG, wavelength_nm
    )


def test_sunlight_carries_about_two_micromoles_of_par_per_joule():
    # Jacovides et al. (2003) and others: 1.9 to 2.1 µmol J⁻¹ of global radiation.
    beam, diffuse = spectrum(900.0, 100.0, par_bands())
    total = beam.sum() * np.cos(np.radians(40.0)) + diffuse.sum()
    assert total / (900.0 * np.cos(np.radians(40.0)) + 100.0) == pytest.approx(2.0, abs=0.1)


def test_light_is_proportional_to_the_broadband_input():
    one, two = (spectrum(w, 0.1 * w, par_bands()) for w in (400.0, 800.0))
    assert two[0] == pytest.approx(2 * one[0])
    assert two[1] == pytest.approx(2 * one[1])


def test_scaled_over_its_whole_range_the_spectrum_returns_the_broadband_input():
    from dapple.optics.bands import photon_flux

    nm = np.arange(300.0, 4000.1, 1.0)
    for part, watts in zip(spectrum(700.0, 300.0, nm), (700.0, 300.0), strict=True):
        energy = (part[0] / photon_flux(1.0, nm)).sum()
        assert energy == pytest.approx(watts, rel=2e-3)


def test_a_blue_sky_is_bluer_than_the_sun_and_an_overcast_sky_is_not():
    beam, clear = spectrum(900.0, 60.0, par_bands())
    _, overcast = spectrum(0.0, 300.0, par_bands())
    blue = {
        name: part[0, :20].sum() / part.sum()
        for name, part in {"sun": beam, "clear": clear, "overcast": overcast}.items()
    }
    assert blue["clear"] > 1.4 * blue["sun"]
    assert blue["overcast"] < 1.2 * blue["sun"]


def test_the_less_of_the_sun_clouds_let_through_the_less_of_the_sky_is_blue():
    none, some, more = (spectrum(watts, 500.0, par_bands())[1] for watts in (0.0, 100.0, 200.0))
    assert more - none == pytest.approx(2 * (some - none))
    assert (some - none)[0, :20].sum() > 0.1


# --- sky ------------------------------------------------------------------------------------


def perez_sky(zenith_deg, beam, diffuse, outside=1330.0):
    """Coefficients of skies with the sun in the south, and what they look like."""
    zenith_deg = np.atleast_1d(np.asarray(zenith_deg, float))
    south = np.full(len(zenith_deg), 180.0)
    beam, diffuse, outside = (np.broadcast_to(x, len(zenith_deg)) for x in (beam, diffuse, outside))
    found = perez.coefficients(Conditions(zenith_deg, south, beam, diffuse, outside))
    return lambda *way: perez.radiance(found, Ways.under(zenith_deg, south, *way))


def test_a_perez_sky_without_coefficients_is_even():
    ways = Ways.under(35.0, 180.0, [0.0, 60.0, 89.0], [0.0, 10.0, 300.0])
    assert (perez.radiance(np.zeros(5), ways) == 1).all()


def test_a_clear_sky_is_brightest_around_the_sun_and_an_overcast_sky_overhead():
    angles = np.linspace(0.0, 85.0, 18)
    clear, overcast = perez_sky(50.0, 850.0, 80.0), perez_sky(50.0, 0.0, 200.0)
    towards, away = (clear(angles, azimuth)[0] for azimuth in (180.0, 0.0))
    assert angles[towards.argmax()] == 50.0
    assert (towards[5:] > away[5:]).all()
    dome = overcast(angles, 90.0)[0]
    assert (np.diff(dome) < 0).all()
    # The traditional overcast sky of the CIE, the extreme, is three times as bright overhead.
    assert 1.3 < dome[0] / dome[-1] < 3


def test_no_sky_is_ever_negative_or_dark():
    rng = np.random.default_rng(5)
    n = 3000
    beam = rng.uniform(0, 1000, n) * (rng.random(n) > 0.2)
    sky = perez_sky(rng.uniform(0, 89.9, n), beam, rng.uniform(1, 500, n), 1350.0)
    found = sky(*np.meshgrid([0.0, 30.0, 60.0, 85.0], [0.0, 90.0, 180.0]))
    assert (found > 0).all()
    assert (found.mean(axis=(1, 2)) > 0.05).all()


def test_an_isotropic_day_differs_from_a_perez_day_only_in_the_distribution():
    clear, even = day(), day("isotropic")
    assert "sky_coefficients" not in even
    assert (np.abs(clear["sky_coefficients"]).sum("coefficient") > 0).any()
    assert sky_radiance.isotropic(clear).equals(even)
    assert sky_radiance.isotropic(clear).attrs == even.attrs
    with pytest.raises(InputError, match="'cie'"):
        day("cie")


# --- sky patches ----------------------------------------------------------------------------


@pytest.mark.parametrize("n", SUBDIVISIONS)
def test_patches_cover_the_hemisphere_once(n):
    dome = patches(n)
    assert dome.n == n
    assert dome.solid_angle_sr.sum() == pytest.approx(2 * np.pi, rel=1e-12)
    assert dome.projected_solid_angle_sr.sum() == pytest.approx(np.pi, rel=1e-12)


@pytest.mark.parametrize("n", SUBDIVISIONS)
def test_every_direction_falls_into_its_own_patch(n):
    dome = patches(n)
    assert (dome.index(dome.directions) == np.arange(n)).all()
    samples = dome.sample(np.random.default_rng(1).uniform(0.001, 0.999, (20, 2)))
    assert (dome.index(samples) == np.arange(n)[:, np.newaxis]).all()
    assert np.linalg.norm(samples, axis=-1) == pytest.approx(1.0)


def test_uniform_directions_hit_patches_in_proportion_to_their_solid_angle():
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(400_000, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, np.newaxis]
    index = patches(145).index(direction)
    assert ((index == -1) == (direction[:, 2] < 0)).all()
    expected = (index >= 0).sum() * patches(145).solid_angle_sr / (2 * np.pi)
    chi_squared = ((np.bincount(index[index >= 0], minlength=145) - expected) ** 2 / expected).sum()
    assert chi_squared < 200  # 144 degrees of freedom: exceeded once in a thousand


def test_the_first_patch_looks_north_and_the_next_one_east_of_it():
    dome = patches(145)
    assert dome.index(np.array([0.0, 0.99, 0.05])) == 0
    assert dome.index(np.array([np.sin(0.2), np.cos(0.2), 0.05])) == 1
    assert dome.index(np.array([0.0, 0.0, 1.0])) == 144


def test_only_known_subdivisions_exist():
    with pytest.raises(InputError, match="145, 577, 2305"):
        patches(100)


@pytest.mark.parametrize("n", [1, 145, 577])
def test_patch_radiances_add_up_to_a_horizontal_irradiance_of_one(n):
    dataset = day()
    radiance = sky_radiance.patch_radiance(dataset, patches(n))
    assert radiance @ patches(n).projected_solid_angle_sr == pytest.approx(1.0)
    assert (radiance >= 0).all()
    if n == 1:
        assert radiance == pytest.approx(1 / np.pi)


def test_the_brightest_patch_of_a_clear_sky_holds_the_sun():
    dataset = day().sel(time="2023-08-10T14:00")
    zenith, azimuth = np.radians(dataset["sun_zenith_deg"]), np.radians(dataset["sun_azimuth_deg"])
    to_sun = np.array(
        [np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)]
    )
    radiance = sky_radiance.patch_radiance(dataset, patches(577))
    assert radiance[0].argmax() == patches(577).index(to_sun)


# --- files ----------------------------------------------------------------------------------


def test_a_sky_comes_back_from_its_file_as_it_went_and_always_with_the_same_bytes(tmp_path):
    dataset = day()
    for name in ("a.nc", "b.nc"):
        files.write(tmp_path / name, dataset)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
    back = files.read(tmp_path / "a.nc")
    # The file tells besides what it is and who made it.
    back.attrs = {name: back.attrs[name] for name in dataset.attrs}
    assert back.identical(dataset)
    assert files.times(back)[0] == pd.Timestamp("2023-08-10 03:00", tz="UTC")


def test_optics_come_back_from_their_file(tmp_path):
    optics = scene_optics.from_spectra()
    scene_optics.write(tmp_path / "optics.nc", optics)
    back = scene_optics.read(tmp_path / "optics.nc")
    assert (back.wavelength_nm == optics.wavelength_nm).all()
    for kind in ("reflectance", "transmittance"):
        before, after = getattr(optics, kind), getattr(back, kind)
        assert list(after) == list(before)
        assert all((after[name] == before[name]).all() for name in before)


def test_a_variable_without_a_unit_is_not_written(tmp_path):
    dataset = day()
    del dataset["ghi_w_m2"].attrs["units"]
    with pytest.raises(ValueError, match="no units or long_name on ghi_w_m2"):
        files.write(tmp_path / "sky.nc", dataset)
    assert not list(tmp_path.iterdir())


def test_a_broken_file_or_one_without_a_time_zone_is_refused(tmp_path):
    (tmp_path / "broken.nc").write_bytes(b"CDF")
    with pytest.raises(InputError, match="unreadable"):
        files.read(tmp_path / "broken.nc")
    with pytest.raises(InputError, match="no file"):
        files.read(tmp_path / "none.nc")
    dataset = day()
    del dataset["time"].attrs["time_zone"]
    with pytest.raises(InputError, match="time_zone"):
        files.times(dataset)


def test_times_reach_utc_whatever_their_zone():
    berlin = pd.date_range("2023-08-10 12:00", periods=2, freq="h", tz="Europe/Berlin")
    assert list(utc(berlin).hour) == [10, 11]


def test_a_gain_makes_sun_and_sky_brighter_and_leaves_the_rest_alone():
    sky = day()
    brighter = sky_radiance.scaled(sky, 0.95)
    for name in sky.data_vars:
        factor = 0.95 if name in sky_radiance.FLUXES else 1.0
        np.testing.assert_allclose(brighter[name], factor * sky[name], rtol=1e-12)
        assert brighter[name].attrs == sky[name].attrs
    assert brighter.attrs["gain"] == 0.95
