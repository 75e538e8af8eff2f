"""What people and loggers call the columns of their tables."""

import re
import unicodedata
from collections.abc import Iterable

UNIT_IN_HEADER = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
UNIT_AT_END = re.compile(r"^(?P<name>.+?)\s*(?:,|\s-|\sin)\s+(?P<unit>[^,]+)$")
"""`Solar Rad. - W/m^2`, `PAR, uE`, `irradiance in W/sq m`."""
UNIT_BEFORE = re.compile(r"^(?P<unit>[kMmuµμ]?(?:Wh?|J|mol)[^\w\s]\S*)\s+(?P<name>.+)$")
"""`W/m² Solar Radiation`."""
SERIAL = re.compile(r"\s*\([^()]*:[^()]*\)(?:\s*,(?P<unit>[^,]*).*)?\s*$")
"""What Onset's loggers add: `(LGR S/N: 1, SEN S/N: 2)`, or `(S-LIB 2:2-1),W/m^2,Plot`."""
UNIT_BEHIND = re.compile(r"[_ ]+k?w[_/ ]?m\^?-?[2²]$", re.IGNORECASE)
"""`ghi_wm2`."""
OF_MEANS = re.compile(r"[_ .](avg|average|mean|mittel|tot|sum)\d*$", re.IGNORECASE)
"""What Campbell's loggers add to a name."""

TIME = ("time_utc", "time", "timestamp", "datetime", "date_time", "date time", "date/time",
        "date & time", "date and time", "timestamp_utc", "datetime_utc", "utc", "local_time",
        "zeit", "zeitstempel", "zeitpunkt", "messzeit", "datum/uhrzeit", "datum uhrzeit",
        "datum/zeit", "datum und uhrzeit", "date/heure", "date heure", "horodatage", "fecha/hora",
        "fecha hora", "fechahora", "data/ora", "data ora", "data/hora", "reference_timestamp",
        "observation_time", "record_time", "tmstamp", "unix_time", "unixtime", "epoch",
        "timestamps", "valid_time", "measurement_time", "tid", "tidpunkt", "tidspunkt", "tijd",
        "aika")  # fmt: skip
"""Columns of whole time stamps, the likeliest first."""
START = ("start", "from", "start_time", "start_date", "begin", "beginn", "anfang", "von", "debut",
         "inicio", "inizio", "desde", "interval_start", "period_start")  # fmt: skip
END = ("end", "to", "end_time", "end_date", "stop", "ende", "bis", "fin", "fine", "fim", "hasta",
       "interval_end", "period_end")  # fmt: skip
"""Columns that together tell the interval of a row."""
DATE = ("date", "datum", "fecha", "data", "dato", "day", "date_utc", "date_local", "yyyymmdd",
        "local_date")  # fmt: skip
CLOCK = ("time", "clock", "uhrzeit", "zeit", "heure", "hora", "ora", "tid", "time_utc",
         "time_local",         "hour", "hhmm", "hh:mm", "local_time")  # fmt: skip
"""Columns of days and of times of the day, where they are apart."""
YEAR = ("year", "yr", "yyyy", "jahr", "annee", "ano",
        "year month day hours minutes in yyyy")  # fmt: skip
MONTH = ("month", "mon", "mo", "mm", "monat", "mois", "mes")
DAY_OF_MONTH = ("day", "dy", "dd", "tag", "jour", "dia")
DAY_OF_YEAR = ("doy", "jday", "julian_day", "day_of_year", "yday", "ddd")
HOUR = ("hour", "hr", "hh", "stunde", "heure", "hora", "hh24")
SECOND = ("second", "seconds", "sec", "ss", "sekunde", "sekunden", "seconde", "segundo")
MINUTE = ("minute", "minutes", "min", "mi", "mn", "mi format in local standard time")

GLOBAL = ("global_W_m2", "global", "ghi", "globalstrahlung", "global_radiation",
          "global_irradiance", "global_horizontal", "global_horizontal_irradiance",
          "global_solar_radiation", "globalstr", "global_rad", "glo", "solarstrahlung",
          "sonnenstrahlung", "rayonnement_solaire", "radiacion_solar", "radiazione_solare",
          "radiacao_solar", "rayonnement_global", "radiacion_global",
          "radiacao_global", "radiazione_globale", "globalstraling", "globalstraalning",
          "sw_in", "sw_in_f", "swin", "sw_down", "swdown", "sw_dn", "swd", "rsds", "ssrd",
          "dw_solar", "shortwave_in", "shortwave_down", "shortwave_radiation",
          "incoming_shortwave",
          "incoming_shortwave_radiation", "solar_radiation", "solar_rad", "solar_irradiance",
          "solar", "slrw", "slrkj", "slrmj", "srad", "global_irradians", "sunindstraaling",
          "mean_global_irradiance", "globalbestraling", "globaalistraaling", "solrad", "sol_rad",
          "strahlung", "rg", "rs", "rsd", "k_down",
          "kdown", "cglo", "gre000z0", "gre000h0", "allsky_sfc_sw_dwn", "pyranometer", "radiation",
          "irradiance", "total")  # fmt: skip
DIFFUSE = ("diffuse_W_m2", "diffuse", "dhi", "diffus", "diffusstrahlung", "diffuse_radiation",
           "diffuse_irradiance", "diffuse_horizontal", "diffuse_horizontal_irradiance",
           "diffuse_solar_radiation", "diffuse_hemispherical", "himmelsstrahlung",
           "diffuse_himmelsstrahlung", "rayonnement_diffus", "radiacion_difusa",
           "radiazione_diffusa", "sw_dif", "sw_diffuse", "dif", "diff", "rd", "rdif", "k_diffuse",
           "chim", "allsky_sfc_sw_diff", "ods000z0", "ods000h0")  # fmt: skip
DIRECT_NORMAL = ("direct_normal_W_m2", "dni", "bni", "direct_normal", "direct_normal_irradiance",
                 "direct_normal_radiation", "beam_normal", "beam_normal_irradiance", "gb(n)",
                 "normal_direct_radiation", "direktnormalstrahlung", "allsky_sfc_sw_dni",
                 "rayonnement_direct_normal", "radiacion_directa_normal")  # fmt: skip
DIRECT_HORIZONTAL = ("direct_horizontal_W_m2", "bhi", "direct_horizontal",
                     "direct_horizontal_irradiance", "beam_horizontal", "gb(h)", "fdir",
                     "horizontal_direct_radiation", "rayonnement_direct_horizontal")  # fmt: skip
DIRECT = ("direct_W_m2", "direct", "beam", "direct_radiation", "direct_irradiance",
          "beam_radiation", "beam_irradiance", "direktstrahlung", "direkt", "rayonnement_direct",
          "radiacion_directa", "sw_dir", "dir")  # fmt: skip
"""Direct radiation that faces the sun, on the horizontal, or on a plane that the name hides."""
PAR = ("par_umolm2s", "par_umol_m2_s", "par", "ppfd", "ppfd_in", "par_in", "par_down", "qpar",
       "ppf", "photon_flux", "photon_flux_density", "photosynthetic_photon_flux", "par_den",
       "par_flux", "par_flux_density", "quantum_flux", "ppfd_umol", "par_umol",
       "photosynthetic_photon_flux_density",
       "photosynthetically_active_radiation", "quantum", "parlite")  # fmt: skip
SENSOR = ("sensor", "label", "sensor_id", "sensor_label", "sensor_name")


def plain(name: str) -> str:
    """A name without its unit, accents and signs, in small letters: `Globalstrahlung [W/m²]` and
    `GLOBALSTRAHLUNG_Avg` are `globalstrahlung`."""
    while match := UNIT_IN_HEADER.match(name.strip()):  # `Solar Radiation (W/m²) (S-LIB:1)`
        name = match["name"]
    if match := UNIT_BEFORE.match(name.strip()) or UNIT_AT_END.match(name.strip()):
        name = match["name"]
    name = SERIAL.sub("", name)
    name = OF_MEANS.sub("", UNIT_BEHIND.sub("", name.strip()))
    letters = unicodedata.normalize("NFKD", name.replace("ß", "ss")).lower()
    return re.sub(r"[^a-z0-9]", "", letters)


def first(names: Iterable[str], columns: Iterable[str]) -> str | None:
    """The first of the names that a column has, as the table spells it; None: none of them."""
    columns = list(columns)
    spelled = {plain(column): column for column in reversed(columns) if plain(column)}
    names = list(names)
    exact = (name for name in names if name in columns)
    loose = (spelled[plain(name)] for name in names if plain(name) in spelled)
    return next(exact, None) or next(loose, None)
