"""Where the sun stands, and how much radiation reaches the top of the tree."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pvlib

from dapple.times import utc


@dataclass(frozen=True)
class Site:
    """A place on Earth: north and east positive [°], metres above sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0

    @property
    def place(self) -> tuple[float, float, float]:
        """Latitude and longitude [°], altitude [m]."""
        return self.latitude_deg, self.longitude_deg, self.altitude_m


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
    zenith = position(times, *site.place)["sun_zenith_deg"].to_numpy()
    turbidity = _monthly_turbidity(times, site) if linke_turbidity is None else linke_turbidity
    pressure = pvlib.atmosphere.alt2pres(site.altitude_m)
    above = np.minimum(zenith, 89.9)  # at the horizon itself the model divides by zero
    airmass = pvlib.atmosphere.get_relative_airmass(above)
    model = pvlib.clearsky.ineichen(
        above,
        pvlib.atmosphere.get_absolute_airmass(airmass, pressure),
        turbidity,
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


def mean_clear_sky(
    intervals_ns: np.ndarray,
    site: Site,
    *,
    linke_turbidity: float | None = 3.0,
    sample_min: float = 1.0,
) -> np.ndarray:
    """Direct and diffuse radiation (2, n) of a clear sky, means over intervals (2, n) [W m⁻²].

    The mean of samples in steps of `sample_min`; one at the middle of an interval of no length.
    """
    start, end = intervals_ns
    length_min = (end[0] - start[0]) / 60e9 if len(start) else 0.0
    samples = max(1, round(length_min / sample_min))
    share = (np.arange(samples) + 0.5) / samples
    moments = (start[:, None] + share * (end - start)[:, None]).astype(np.int64)
    index = pd.DatetimeIndex(pd.to_datetime(moments.ravel(), utc=True))
    parts = direct_diffuse(clear_sky(index, site, linke_turbidity=linke_turbidity))
    return parts.reshape(2, len(start), samples).mean(axis=2)


def direct_diffuse(radiation: pd.DataFrame) -> np.ndarray:
    """Direct and diffuse irradiance (2, t) of a table with global and diffuse [W m⁻²]."""
    diffuse = radiation["diffuse_w_m2"].to_numpy(float)
    return np.stack([radiation["global_w_m2"].to_numpy(float) - diffuse, diffuse])


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


def _monthly_turbidity(times: pd.DatetimeIndex, site: Site) -> np.ndarray:
    """Linke turbidity (t,), linear between the middles of the months."""
    months = pd.date_range("2001-01-01", periods=12, freq="MS", tz="UTC")
    monthly = pvlib.clearsky.lookup_linke_turbidity(
        months, site.latitude_deg, site.longitude_deg, interp_turbidity=False
    ).to_numpy()
    middles = months.day_of_year.to_numpy() + 14.0
    return np.interp(day_of_year(times), middles, monthly, period=365.25)
