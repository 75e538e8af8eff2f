"""Times as people write them: zone, form, summer time."""

import pandas as pd
import pytest

from dapple import time_formats, timezones
from dapple.errors import InputError
from dapple.times import hourly, parse, spread, time_range, utc


def parsed(*texts, zone=None, name="time", **options):
    column = pd.Series(list(texts), name=name, index=range(2, 2 + len(texts)))
    return [f"{time:%Y-%m-%d %H:%M}" for time in parse(column, "par.csv", zone, **options)]


def test_summer_time_in_freiburg_is_two_hours_ahead_of_utc():
    both = parsed("2023-08-10 12:30", "2023-12-10 12:30", zone="Europe/Berlin")
    assert both == ["2023-08-10 10:30", "2023-12-10 11:30"]


def test_a_zone_in_the_timestamps_wins_over_the_declared_one():
    assert parsed("2023-08-10T12:30:00-06:00", zone="Europe/Berlin") == ["2023-08-10 18:30"]


def test_rows_without_an_offset_are_in_the_declared_zone_beside_rows_with_one():
    rows = ("2023-08-10 12:30:00+02:00", "2023-08-10 12:40:00")
    assert parsed(*rows, zone="Europe/Berlin") == ["2023-08-10 10:30", "2023-08-10 10:40"]
    with pytest.raises(InputError, match=r"naive timestamp .* beside others with an offset"):
        parsed(*rows)


@pytest.mark.parametrize(
    ("zone", "hour"),
    [
        ("-03:30", "16:00"),
        ("UTC+1", "11:30"),
        ("UTC+01:00", "11:30"),
        ("GMT-2", "14:30"),
        ("Etc/GMT-2", "10:30"),
        ("MEZ", "11:30"),
        ("MESZ", "10:30"),
        ("PDT", "19:30"),
        ("EST", "17:30"),
        ("utc", "12:30"),
        ("Asia/Kolkata", "07:00"),
    ],
)
def test_offsets_and_abbreviations_are_zones(zone, hour):
    assert parsed("2023-08-10 12:30", zone=zone) == [f"2023-08-10 {hour}"]


@pytest.mark.parametrize("zone", ["IST", "CST", "BST"])
def test_an_abbreviation_of_several_zones_is_refused_with_all_of_them(zone):
    with pytest.raises(InputError, match=r"one of several: .*\+0\d:\d\d or"):
        parsed("2023-08-10 12:30", zone=zone)


def test_an_unknown_zone_names_the_nearest_valid_one():
    with pytest.raises(InputError, match="Did you mean 'Europe/Berlin'"):
        parsed("2023-08-10 12:30", zone="Europe/Brelin")


def test_zones_that_hide_summer_time_or_turn_the_sign_are_pointed_out():
    assert "stays on winter time all year is '+01:00'" in timezones.note("CET")
    assert "'+02:00'" in timezones.note("EET")
    assert "1 h west of Greenwich (-01:00)" in timezones.note("Etc/GMT+1")
    assert not any(map(timezones.note, ("UTC", "Europe/Berlin", "+01:00", None)))


def test_a_naive_time_without_a_zone_is_refused():
    with pytest.raises(InputError, match=r"par.csv.*found the naive timestamp 2023-08-10 12:30:00"):
        parsed("2023-08-10 12:30")
    with pytest.raises(InputError, match="naive timestamp"):
        utc(["2023-08-10 12:30"])


@pytest.mark.parametrize("time", ["2023-10-29 02:30", "2023-03-26 02:30"])
def test_a_wall_clock_time_that_daylight_saving_doubles_or_skips_is_refused(time):
    with pytest.raises(InputError, match=r"daylight saving.*declare its offset, here '\+01:00'"):
        parsed(time, zone="Europe/Berlin")


def test_the_hour_that_autumn_repeats_is_told_apart_in_every_sensors_own_series():
    night = ["2023-10-29 01:30", "2023-10-29 02:00", "2023-10-29 02:30", "2023-10-29 02:00",
             "2023-10-29 02:30", "2023-10-29 03:00"]  # fmt: skip
    column = pd.Series(night * 2, name="time")
    sensor = pd.Series(["a"] * 6 + ["b"] * 6)
    times = parse(column, "par.csv", "Europe/Berlin", group=sensor)
    assert (pd.Series(times[:6]).diff().dropna() == pd.Timedelta(minutes=30)).all()
    assert times[6:].equals(times[:6])


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("2023-08-10T10:10:00.5Z", "2023-08-10 10:10"),
        ("2023-08-10 12:10 MESZ", "2023-08-10 10:10"),
        ("202308101010", "2023-08-10 10:10"),
        ("2023081010", "2023-08-10 10:00"),
        ("2023081010:23", "2023-08-10 10:23"),
        ("Aug 10 2023 10:10", "2023-08-10 10:10"),
        ("10.08.2023 10.10", "2023-08-10 10:10"),
        ("20230810:0010", "2023-08-10 00:10"),
        ("20230810T101000Z", "2023-08-10 10:10"),
        ("10.08.2023 10:10", "2023-08-10 10:10"),
        ("10.08.23 24:00", "2023-08-11 00:00"),
        ("13/8/2023 10:10", "2023-08-13 10:10"),
        ("8/13/23 01:10:00 PM", "2023-08-13 13:10"),
        ("13-08-2023 10:10", "2023-08-13 10:10"),
        ("10-Aug-2023 10:10", "2023-08-10 10:10"),
        ("2023/08/10 10:10", "2023-08-10 10:10"),
        ("2023/8/10 9:10:00 AM", "2023-08-10 09:10"),
        ("2023-08-10 12:10:00+02", "2023-08-10 10:10"),
        ("2023-8-1 9:10", "2023-08-01 09:10"),
        ("2023.08.10 10:10:00", "2023-08-10 10:10"),
        ("2023-08-10_10:10:00", "2023-08-10 10:10"),
    ],
)
def test_times_are_read_as_loggers_and_services_write_them(text, time):
    assert parsed(text, zone="UTC") == [time]


def test_day_and_month_are_told_apart_by_the_step_or_refused():
    two_days = [f"{day}/8/2023 {hour}:00" for day in (9, 10) for hour in range(24)]
    assert parsed(*two_days, zone="UTC")[-1] == "2023-08-10 23:00"
    with pytest.raises(InputError, match="08 October 2023"):
        parsed("10/8/2023 10:10", zone="UTC")
    assert parsed("10/8/2023 10:10", zone="UTC", time_format="%d/%m/%Y %H:%M") == [
        "2023-08-10 10:10"
    ]


def test_a_year_of_two_digits_in_front_is_told_by_the_step_or_refused():
    two_days = [f"23-08-{day:02d} {hour:02d}:00" for day in (9, 10) for hour in range(24)]
    assert parsed(*two_days, zone="UTC")[-1] == "2023-08-10 23:00"
    with pytest.raises(InputError, match="23 August 2010 or 10 August 2023"):
        parsed("23-08-10 10:10", zone="UTC")


def test_numbers_are_times_only_where_that_is_declared():
    assert parsed("1691625600", time_format="epoch") == ["2023-08-10 00:00"]
    assert parsed("45148.5", zone="UTC", time_format="excel") == ["2023-08-10 12:00"]
    for text, remedy in (
        ("1691625600", "time_format: epoch"),
        ("45148.5", "time_format: excel"),
        ("1691625", "ten digits"),
    ):
        with pytest.raises(InputError, match=remedy):
            parsed(text, zone="UTC")


def test_the_row_that_is_no_time_is_named():
    with pytest.raises(InputError, match="line 3: found 'noon'"):
        parsed("2023-08-10 10:10", "noon", zone="UTC")
    with pytest.raises(InputError, match="line 3: found empty"):
        parsed("2023-08-10 10:10", "", zone="UTC")
    with pytest.raises(InputError, match=r"line 2: .*as `time_format"):
        parsed("10:10", zone="UTC", time_format="%d.%m.%Y %H:%M")


def test_wanted_times_are_on_the_declared_clock():
    day = time_range("2023-12-21 10:00", "2023-12-21 18:00", 60, "America/Santiago")
    assert spread(day, ["2023-12-21 17:00"], 4, "America/Santiago").tolist() == [7]
    assert spread(day, ["2023-12-21 17:00Z"], 4, "America/Santiago").tolist() == [4]


def test_hours_are_those_of_the_middle_day_on_its_clock():
    days = time_range("2023-08-10 00:00", "2023-08-12 23:50", 10, "Asia/Kolkata")
    chosen = days[hourly(days, "Asia/Kolkata")].tz_convert("Asia/Kolkata")
    assert len(chosen) == 24
    assert set(chosen.day) == {11}
    assert set(chosen.minute) == {0}


def test_a_run_of_less_than_some_hours_is_spread_and_one_of_one_time_is_kept():
    short = time_range("2023-08-10 10:10", "2023-08-10 11:50", 10, "UTC")
    assert len(hourly(short, "UTC")) == 4
    assert hourly(short[:1], "UTC").tolist() == [0]


WAYS = ("%Y-%m-%d %H:%M", "%Y-%m-%d %H:%M:%S", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M:%SZ",
        "%Y-%m-%d %H:%M:%S+00:00", "%d/%m/%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p",
        *time_formats.CLEAR)  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_every_minute_of_a_day_is_read_as_it_was_written(way):
    index = pd.date_range("2023-08-23", periods=1440, freq="min", unit="ns")
    text = pd.Series(index.strftime(way), name="time_utc")
    wanted = pd.DatetimeIndex(pd.to_datetime(text, format=way, utc=True)).as_unit("ns")
    assert (times_of(text) == wanted).all()


def times_of(text):
    return parse(text, "a.csv", "UTC")


@pytest.mark.parametrize(
    "text",
    ["2023-08-10 24:00", "2023-08-10T24:00:00", "202308102400", "20230810240000", "20230810 2400",
     "10.08.2023 24:00", "20230810:2400", "2023-08-10 24:00:00Z"],
)  # fmt: skip
def test_24_hours_are_the_next_midnight(text):
    (time,) = times_of(pd.Series([text], name="time"))
    assert time == pd.Timestamp("2023-08-11", tz="UTC")
