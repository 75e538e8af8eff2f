"""Light integrals of a day, and sunflecks, of series whose sums are known."""

import numpy as np
import pandas as pd
import pytest

from dapple.stats.daily_light import integral_mol_m2, sunflecks

HOUR = pd.date_range("2024-06-01 10:00", periods=61, freq="min", tz="Europe/Berlin")


def test_a_thousand_micromoles_for_an_hour_are_3_6_moles():
    assert integral_mol_m2(np.full((2, 61), 1000.0), HOUR) == pytest.approx([3.6, 3.6])


def test_a_straight_line_is_summed_exactly_where_a_record_is_missing_too():
    par = np.linspace(0, 1000, 61)[None]
    par[0, 20] = np.nan
    assert integral_mol_m2(par, HOUR) == pytest.approx([1.8])


def test_days_are_told_by_the_local_clock_and_averaged():
    times = HOUR.append(HOUR + pd.Timedelta(days=1))
    par = np.concatenate([np.full((1, 61), 1000.0), np.full((1, 61), 2000.0)], axis=1)
    assert integral_mol_m2(par, times) == pytest.approx([5.4])


def test_a_sensor_without_records_has_no_integral():
    assert np.isnan(integral_mol_m2(np.full((1, 61), np.nan), HOUR)).all()


def test_two_flecks_of_six_and_ten_minutes_are_counted_with_their_time_and_light():
    direct = np.zeros((2, 61))
    direct[0, 5:11] = direct[0, 30:40] = 900.0
    par = direct + 100.0
    found = sunflecks(par, direct, np.full(61, 1000.0), HOUR)
    assert found.per_day.tolist() == [2, 0]
    assert found.median_min[0] == pytest.approx(8.0)
    assert np.isnan(found.median_min[1])
    assert found.time_share == pytest.approx([16 / 61, 0])
    assert found.light_share == pytest.approx([16_000 / (16_000 + 4_500), 0])


def test_no_fleck_is_seen_where_less_than_half_of_the_disc_is_or_the_sun_is_down():
    half = np.full((1, 61), 490.0)
    assert sunflecks(half, half, np.full(61, 1000.0), HOUR).time_share == pytest.approx([0])
    night = sunflecks(half, half * 0, np.zeros(61), HOUR)
    assert night.per_day.tolist() == [0]
