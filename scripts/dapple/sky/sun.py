"""Where the sun stands, and how much radiation reaches the top of the tree."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pvlib
from scipy.interpolate import PchipInterpolator

from dapple.errors import InputError
from dapple.times import parse, utc

MAX_IRRADIANCE_W_M2 = 2000.0
MIN_IRRADIANCE_W_M2 = -20.0  # thermopiles read a few watts below zero at night


@dataclass(frozen=True)
class Site:
    """A place on Earth: north and east positive [°], metres above sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0


def position(
    times: pd.DatetimeIndex,
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float = 0.0,
    *,
    temperature_c: float = 12.0,
) -> pd.DataFrame:
    """Direction to the centre of the solar disc.

    Parameters
    ----------
    times : (t,) DatetimeIndex
        Time-zone aware.
    latitude_deg, longitude_deg, altitude_m : float
        North and east positive [°]; above sea level [m].
    temperature_c : float
        Yearly mean air temperature [°C]; with the pressure at this altitude it sets refraction.

    Returns
    -------
    pandas.DataFrame
        By time (UTC): `sun_zenith_deg`, the apparent zenith angle, bent by refraction, which is
        where the light comes from; `sun_azimuth_deg`, clockwise from north.

    Raises
    ------
    InputError
        Naive times.

    Notes
    -----
    Solar position algorithm (SPA) of Reda and Andreas (2004), through pvlib.
    """
    times = utc(times)
    spa = pvlib.solarposition.get_solarposition(
        times,
        latitude_deg,
        longitude_deg,
        altitude=altitude_m,
        temperature=temperature_c,
        method="nrel_numpy",
    )
    return pd.DataFrame(
        {"sun_zenith_deg": spa["apparent_zenith"], "sun_azimuth_deg": spa["azimuth"]}, index=times
    )


def extraterrestrial(times: pd.DatetimeIndex) -> np.ndarray:
    """Irradiance on a plane that faces the sun outside the atmosphere (t,) [W m⁻²]."""
    return np.asarray(pvlib.irradiance.get_extra_radiation(day_of_year(times)), float)


def day_of_year(times: pd.DatetimeIndex) -> np.ndarray:
    """Day of the year (t,) in UTC; pvlib would look it up by a name that pandas gives up."""
    return utc(times).day_of_year.to_numpy()


def clear_sky(
    times: pd.DatetimeIndex,
    site: Site,
    *,
    linke_turbidity: float | None = 3.0,
) -> pd.DataFrame:
    """Broadband radiation under a cloudless sky.

    Parameters
    ----------
    times : (t,) DatetimeIndex
        Time-zone aware.
    site : Site
    linke_turbidity : float or None
        Haze: 2 very clear, 3 clear, 5 hazy. None takes the monthly climatology of pvlib (SoDa),
        which is a mean over all weather and so hazier than a cloudless day.

    Returns
    -------
    pandas.DataFrame
        By time (UTC): `global_w_m2` and `diffuse_w_m2` on the horizontal [W m⁻²]; zero while
        the sun is below the horizon.

    Notes
    -----
    Ineichen and Perez (2002), through pvlib.
    """
    times = utc(times)
    zenith = position(times, *_place(site))["sun_zenith_deg"].to_numpy()
    if linke_turbidity is None:
        linke_turbidity = _monthly_turbidity(times, site)
    pressure = pvlib.atmosphere.alt2pres(site.altitude_m)
    above = np.minimum(zenith, 89.9)  # at the horizon itself the model divides by zero
    airmass = pvlib.atmosphere.get_relative_airmass(above)
    model = pvlib.clearsky.ineichen(
        above,
        pvlib.atmosphere.get_absolute_airmass(airmass, pressure),
        linke_turbidity,
        altitude=site.altitude_m,
        dni_extra=extraterrestrial(times),
    )
    up = zenith < 90.0
    return pd.DataFrame(
        {
            "global_w_m2": np.where(up, model["ghi"], 0.0),
            "diffuse_w_m2": np.where(up, np.clip(model["dhi"], 0.0, model["ghi"]), 0.0),
        },
        index=times,
    )


def read_radiation(
    path: str | Path,
    *,
    time_column: str = "time_utc",
    global_column: str = "global_W_m2",
    diffuse_column: str = "diffuse_W_m2",
    timezone: str | None = None,
) -> pd.DataFrame:
    """Read measured broadband radiation from CSV.

    Parameters
    ----------
    path : path
    time_column, global_column, diffuse_column : str
        Times (see `times.parse`); global and diffuse irradiance on the horizontal [W m⁻²].
    timezone : str or None
        IANA zone of times without an offset; a column that ends in `_utc` needs none.

    Returns
    -------
    pandas.DataFrame
        By ascending time (UTC): `global_w_m2`, `diffuse_w_m2`, between 0 and global.

    Raises
    ------
    InputError
        No file or column, unreadable or repeated times, missing or impossible values.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "a CSV table of radiation", "Check the path.")
    raw = pd.read_csv(path)
    columns = [time_column, global_column, diffuse_column]
    if missing := [name for name in columns if name not in raw]:
        raise InputError(
            path,
            f"columns {', '.join(map(str, raw.columns))}",
            f"columns {', '.join(missing)}",
            "Name the columns in the configuration.",
        )
    table = raw[columns[1:]].set_axis(["global_w_m2", "diffuse_w_m2"], axis="columns")
    table.index = parse(raw[time_column], path, timezone)
    table = table.sort_index()
    _check_radiation(table, path)
    table = table.clip(lower=0.0)
    return table.assign(diffuse_w_m2=table["diffuse_w_m2"].clip(upper=table["global_w_m2"]))


def radiation_at(
    table: pd.DataFrame,
    times: pd.DatetimeIndex,
    site: Site,
    *,
    linke_turbidity: float | None = 3.0,
    max_gap_min: float = 60.0,
) -> pd.DataFrame:
    """Interpolate a radiation table to the wanted times, and model what it does not cover.

    Inside the table values come from a monotone cubic spline (PCHIP, which does not overshoot).
    Before, after and in gaps of the table they come from the clear-sky model, times the ratio of
    table to model at the nearest ends, so that the series is continuous.

    Parameters
    ----------
    table : pandas.DataFrame
        As `read_radiation` returns it.
    times : (t,) DatetimeIndex
        Time-zone aware.
    site : Site
    linke_turbidity : float or None
        See `clear_sky`.
    max_gap_min : float
        Rows further apart than this are a gap [min].

    Returns
    -------
    pandas.DataFrame
        By time (UTC): `global_w_m2`, `diffuse_w_m2`, and `modelled`, true where the clear-sky
        model stands in.

    Raises
    ------
    InputError
        The table and the times do not overlap.
    """
    times = utc(times)
    known, wanted = table.index.asi8, times.asi8
    if len(times) and (times.max() < table.index[0] or times.min() > table.index[-1]):
        raise InputError(
            "radiation table",
            f"{table.index[0]} to {table.index[-1]}",
            f"an overlap with the times {times.min()} to {times.max()}",
            "Check dates and time zones, or use the clear-sky model.",
        )
    model = _direct_diffuse(clear_sky(times, site, linke_turbidity=linke_turbidity))
    at_table = _direct_diffuse(clear_sky(table.index, site, linke_turbidity=linke_turbidity))
    measured = _direct_diffuse(table)
    # Direct and diffuse are treated apart, so that diffuse can never exceed global.
    ratio = np.where(at_table > 1.0, measured / np.maximum(at_table, 1.0), 1.0)
    after = np.clip(np.searchsorted(known, wanted), 1, max(len(known) - 1, 1))
    gap_ns = max_gap_min * 60e9
    spanned = (wanted >= known[0]) & (wanted <= known[-1])
    if len(known) > 1:
        spanned &= (known[after] - known[after - 1] <= gap_ns) | np.isin(wanted, known)
    parts = np.empty_like(model)
    for k in range(2):
        parts[k] = model[k] * np.interp(wanted, known, ratio[k])
        if len(known) > 1:
            spline = PchipInterpolator(known.astype(float), measured[k])
            parts[k, spanned] = spline(wanted[spanned].astype(float))
    up = position(times, *_place(site))["sun_zenith_deg"].to_numpy() < 90.0
    parts = np.where(up, np.maximum(parts, 0.0), 0.0)
    return pd.DataFrame(
        {"global_w_m2": parts.sum(axis=0), "diffuse_w_m2": parts[1], "modelled": ~spanned},
        index=times,
    )


def radiation_from_table(
    path: str | Path,
    times: pd.DatetimeIndex,
    site: Site,
    *,
    time_column: str = "time_utc",
    global_column: str = "global_W_m2",
    diffuse_column: str = "diffuse_W_m2",
    timezone: str | None = None,
    linke_turbidity: float | None = 3.0,
    max_gap_min: float = 60.0,
) -> pd.DataFrame:
    """Read a radiation table and interpolate it: `read_radiation`, then `radiation_at`."""
    table = read_radiation(
        path,
        time_column=time_column,
        global_column=global_column,
        diffuse_column=diffuse_column,
        timezone=timezone,
    )
    return radiation_at(
        table, times, site, linke_turbidity=linke_turbidity, max_gap_min=max_gap_min
    )


def direct_normal(
    radiation: pd.DataFrame, sun_zenith_deg: np.ndarray, extraterrestrial_w_m2: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Split global radiation into the beam and the rest.

    Parameters
    ----------
    radiation : pandas.DataFrame
        `global_w_m2`, `diffuse_w_m2` (t,).
    sun_zenith_deg : (t,) float
        Apparent zenith angle [°].
    extraterrestrial_w_m2 : (t,) float
        The most that the beam can be [W m⁻²].

    Returns
    -------
    direct_normal_w_m2, diffuse_w_m2 : (t,) float64
        On a plane facing the sun, and on the horizontal; zero while the sun is down. A beam
        that would exceed the extraterrestrial one (low sun, horizon in the way of the station)
        is cut, and the remainder counted as diffuse, so that global is kept.
    """
    cosine = np.cos(np.radians(np.asarray(sun_zenith_deg, float)))
    up = cosine > 0
    total = np.where(up, radiation["global_w_m2"], 0.0)
    diffuse = np.where(up, radiation["diffuse_w_m2"], 0.0)
    beam = np.divide(total - diffuse, cosine, out=np.zeros_like(total), where=up)
    beam = np.clip(beam, 0.0, extraterrestrial_w_m2)
    return beam, np.where(up, total - beam * cosine, 0.0)


def _place(site: Site) -> tuple[float, float, float]:
    return site.latitude_deg, site.longitude_deg, site.altitude_m


def _direct_diffuse(radiation: pd.DataFrame) -> np.ndarray:
    """(2, t): direct and diffuse irradiance on the horizontal [W m⁻²]."""
    diffuse = radiation["diffuse_w_m2"].to_numpy(float)
    return np.stack([radiation["global_w_m2"].to_numpy(float) - diffuse, diffuse])


def _monthly_turbidity(times: pd.DatetimeIndex, site: Site) -> np.ndarray:
    """Linke turbidity (t,), linear between the middles of the months."""
    months = pd.date_range("2001-01-01", periods=12, freq="MS", tz="UTC")
    monthly = pvlib.clearsky.lookup_linke_turbidity(
        months, site.latitude_deg, site.longitude_deg, interp_turbidity=False
    ).to_numpy()
    middles = months.day_of_year.to_numpy() + 14.0
    return np.interp(day_of_year(times), middles, monthly, period=365.25)


def _check_radiation(table: pd.DataFrame, path: Path) -> None:
    if table.empty:
        raise InputError(path, "no rows", "radiation by time", "Is the file complete?")
    if table.index.has_duplicates:
        raise InputError(
            path,
            f"{table.index[table.index.duplicated()][0]} more than once",
            "each time once",
            "Remove the repeated rows.",
        )
    for name, column in table.items():
        wrong = ~column.between(MIN_IRRADIANCE_W_M2, MAX_IRRADIANCE_W_M2)
        if wrong.any():
            raise InputError(
                path,
                f"{name} = {column[wrong].iloc[0]} at {table.index[wrong][0]}",
                f"{MIN_IRRADIANCE_W_M2:g} to {MAX_IRRADIANCE_W_M2:g} W m⁻²",
                "Remove the row: the gap is interpolated.",
            )


def broadband(
    times: pd.DatetimeIndex,
    site: Site,
    *,
    kind: str,
    path: str | Path | None = None,
    linke_turbidity: float | None = 3.0,
    **table,
) -> pd.DataFrame:
    """Global and diffuse radiation at the wanted times, modelled or from a file.

    Parameters
    ----------
    times : (t,) DatetimeIndex
        Time-zone aware.
    site : Site
    kind : {"clear_sky", "table"}
        Where they come from.
    path : path
        The file, for "table".
    linke_turbidity : float or None
        See `clear_sky`.
    **table
        Columns, zone and largest gap of the file: see `radiation_from_table`.
    """
    if kind == "clear_sky":
        return clear_sky(times, site, linke_turbidity=linke_turbidity)
    return radiation_from_table(path, times, site, linke_turbidity=linke_turbidity, **table)
