"""EnergyPlus and TMY3 files are read as pvlib reads them, and a typical year serves any year."""

import numpy as np
import pandas as pd
import pvlib
import pytest
from tests.unit.weather import FREIBURG

from dapple.errors import InputError
from dapple.sky import radiation_series, radiation_table, sun, typical_years

YEARS = (1988, 2003, 1991, 1995, 2001, 1989, 1999, 2004, 1992, 1990, 2000, 1997)
HEAD = (
    "LOCATION,Freiburg,-,DEU,TMY,108030,48.0009,7.8003,1.0,230.0\n"
    "DESIGN CONDITIONS,0\nTYPICAL/EXTREME PERIODS,0\nGROUND TEMPERATURES,0\n"
    "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0\nCOMMENTS 1,a\nCOMMENTS 2,b\n"
    "DATA PERIODS,{count},1,Data,Sunday, 1/ 1,12/31\n"
)


def hours(years=YEARS):
    """Hours 1 to 24 of every day of a typical year, with a clear sky in each, means."""
    parts = []
    for month, year in enumerate(years, start=1):
        starts = pd.date_range(f"{year}-{month}-01", periods=31 * 24, freq="h", tz="+01:00")
        starts = starts[(starts.month == month) & ~((month == 2) & (starts.day == 29))]
        ends = starts + pd.Timedelta(hours=1)
        beam, diffuse = sun.mean_clear_sky(
            np.stack([starts.as_unit("ns").asi8, ends.as_unit("ns").asi8]),
            FREIBURG,
            sample_min=10.0,
        )
        parts.append(
            pd.DataFrame(
                {"year": year, "month": month, "day": starts.day, "hour": starts.hour + 1,
                 "total": beam + diffuse, "diffuse": diffuse},
            )
        )  # fmt: skip
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def typical():
    return hours()


def epw(path, table, minute=0):
    rows = (
        f"{r.year:.0f},{r.month:.0f},{r.day:.0f},{r.hour:.0f},{minute},?9,20,10,50,98000,900,1340,"
        f"300,{r.total:.0f},0,{r.diffuse:.0f}" + ",0" * 19
        for r in table.itertuples()
    )
    path.write_text(HEAD.format(count=1) + "\n".join(rows) + "\n")
    return path


def tmy3(path, table):
    names = "Date (MM/DD/YYYY),Time (HH:MM),ETR (W/m^2),GHI (W/m^2),DNI (W/m^2),DHI (W/m^2)"
    rows = (
        f"{r.month:02.0f}/{r.day:02.0f}/{r.year:.0f},{r.hour:02.0f}:00,0,{r.total:.0f},0,"
        f"{r.diffuse:.0f}"
        for r in table.itertuples()
    )
    path.write_text('1,"FREIBURG",CA,1.0,48.0009,7.8003,230\n' + names + "\n" + "\n".join(rows))
    return path


@pytest.mark.parametrize("minute", [0, 60])
def test_epw_is_read_as_pvlib_reads_it(typical, tmp_path, minute):
    path = epw(tmp_path / "a.epw", typical[:2000], minute)
    ours = radiation_table.read(path)
    theirs, _ = pvlib.iotools.read_epw(path)
    # pvlib stamps the start of the hour, and has no half of it.
    starts = pd.DatetimeIndex(theirs.index).tz_convert("UTC").sort_values()
    found = pd.DatetimeIndex(pd.to_datetime(ours.intervals()[0], utc=True))
    assert (found == starts).all()
    assert sorted(ours.table["global_w_m2"]) == sorted(theirs["ghi"])
    assert ours.interval_min == 60.0


def test_tmy3_is_read_as_pvlib_reads_it(typical, tmp_path):
    path = tmy3(tmp_path / "a.csv", typical[:2000])
    ours = radiation_table.read(path)
    theirs, _ = pvlib.iotools.read_tmy3(path, map_variables=True)
    ends = pd.DatetimeIndex(theirs.index).tz_convert("UTC").sort_values()
    assert (ours.table.index == ends).all()
    assert ours.label == "end"
    assert sorted(ours.table["global_w_m2"]) == sorted(theirs["ghi"])


@pytest.mark.parametrize("write", [epw, tmy3])
@pytest.mark.parametrize("year", [2023, 2024])
def test_a_typical_year_gives_the_light_of_any_year_s_days(typical, tmp_path, write, year):
    path = write(tmp_path / "a.csv", typical)
    for day in ("01-01", "03-01", "06-21", "12-31"):
        times = pd.date_range(f"{year}-{day} 09:00", f"{year}-{day} 14:30", freq="30min", tz="UTC")
        found = radiation_series.broadband(times, FREIBURG, kind="table", path=path)
        clear = sun.clear_sky(times, FREIBURG)["global_w_m2"]
        assert not found.values["modelled"].any()
        assert found.values["global_w_m2"].to_numpy() == pytest.approx(clear.to_numpy(), rel=0.02)
        (said,) = [one for one in found.findings if "typical year" in one.found]
        assert said.level == "warning"
        assert "months of 1988 to 2004" in said.found


def test_measured_years_are_no_typical_ones():
    for start, days in (("2022-07-01", 365), ("2021-01-01", 365), ("2019-01-01", 1200)):
        index = pd.date_range(start, periods=24 * days, freq="h", tz="UTC")
        assert not typical_years.is_typical(index)
    every_third = pd.date_range("2019-01-01", periods=365, freq="3D", tz="UTC")
    assert not typical_years.is_typical(every_third)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (",1.0,230.0", ",x,230.0", "hours east of Greenwich"),
        ("2023,8,10,11,", "2023,8,10,25,", "no day or hour"),
        ("DATA PERIODS,1,1,", "DATA PERIODS,1,7,", "7 rows an hour"),
    ],
)
def test_a_broken_epw_is_refused_with_its_line(typical, tmp_path, old, new, said):
    text = HEAD.format(count=1) + "2023,8,10,11,0,?9,20,10,50,98000,900,1340,300,500,0,100,0\n"
    (tmp_path / "a.epw").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said):
        radiation_table.read(tmp_path / "a.epw")


def test_quarter_hours_of_epw_are_told_by_their_minutes(tmp_path):
    rows = "".join(
        f"2023,8,10,11,{minute},?9,20,10,50,98000,900,1340,300,125,0,25,0\n"
        for minute in (15, 30, 45, 60)
    )
    head = HEAD.format(count=1).replace("PERIODS,1,1,", "PERIODS,1,4,")
    (tmp_path / "a.epw").write_text(head + rows)
    found = radiation_table.read(tmp_path / "a.epw")
    assert found.table["global_w_m2"].tolist() == [500.0] * 4
    assert found.table.index[-1] == pd.Timestamp("2023-08-10 10:00", tz="UTC")
