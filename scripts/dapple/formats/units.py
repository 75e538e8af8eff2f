"""Units of light as people write them, and the factors between them."""

import re
from collections.abc import Sequence

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding

SUNLIGHT_UMOL_PER_J = 4.57
"""Photons of 400 to 700 nm in a joule of sunlight of that range (Thimijan and Heins 1983)."""
DAYLIGHT_LX_PER_UMOL = 54.0
"""Lux in a µmol m⁻² s⁻¹ of daylight of 400 to 700 nm (Thimijan and Heins 1983)."""
DAYLIGHT_LM_PER_W = 110.0
"""Lumen in a watt of global radiation: 105 to 115 in most weather (Littlefair 1985)."""

POWERS = {"W/m2": 1.0, "kW/m2": 1e3, "mW/cm2": 10.0, "cal/cm2/min": 4.184e4 / 60,
          "kJ/m2/h": 1e3 / 3600, "MJ/m2/h": 1e6 / 3600, "J/cm2/h": 1e4 / 3600,
          "kJ/m2/min": 1e3 / 60, "MJ/m2/d": 1e6 / 86_400,
          "lx": 1 / DAYLIGHT_LM_PER_W, "klx": 1e3 / DAYLIGHT_LM_PER_W}  # fmt: skip
"""Irradiance in W m⁻²."""
ENERGIES = {"J/m2": 1.0, "kJ/m2": 1e3, "MJ/m2": 1e6, "J/cm2": 1e4, "Wh/m2": 3.6e3, "kWh/m2": 3.6e6,
            "cal/cm2": 4.184e4}  # fmt: skip
"""Sums over an interval, in J m⁻²."""
PHOTONS = {"umol/m2/s": 1.0, "mmol/m2/s": 1e3, "mol/m2/d": 1e6 / 86_400,
           "W/m2": SUNLIGHT_UMOL_PER_J,
           "lx": 1 / DAYLIGHT_LX_PER_UMOL, "klx": 1e3 / DAYLIGHT_LX_PER_UMOL}  # fmt: skip
"""Photon flux of 400 to 700 nm in µmol m⁻² s⁻¹; W/m2: of PAR."""
PHOTON_SUMS = {"mol/m2": 1e6, "mmol/m2": 1e3}
"""Sums over an interval, in µmol m⁻²."""

ILLUMINANCES = ("lx", "klx")
"""What the eye sees: only where somebody declares it, for it holds for daylight alone."""
IRRADIANCES = tuple(unit for unit in (*POWERS, *ENERGIES) if unit not in ILLUMINANCES)
PHOTON_FLUXES = tuple(unit for unit in (*PHOTONS, *PHOTON_SUMS) if unit not in ILLUMINANCES)

# After `_squeezed`: powers, signs and blanks away.
SPELLINGS = {
    "W/m2": ("wm2", "watt", "watts", "w", "wattm2", "wattsm2", "wsqm", "wattspersquaremeter",
             "wattspersquaremetre", "wattpersquaremeter", "wattpersquaremetre", "wqm", "wattqm",
             "jm2s", "jm2s1", "jsm2", "js1m2"),
    "kJ/m2/h": ("kjm2h", "kjm2h1", "kjm2hr", "kjm2hr1", "kjhm2"),
    "MJ/m2/h": ("mjm2h", "mjm2h1", "mjm2hr", "mjm2hr1", "mjhm2"),
    "J/cm2/h": ("jcm2h", "jcm2h1", "jcm2hr"),
    "kJ/m2/min": ("kjm2min", "kjm2min1"),
    "MJ/m2/d": ("mjm2d", "mjm2d1", "mjm2day", "mjm2day1"),
    "kW/m2": ("kwm2", "kw"),
    "mW/cm2": ("mwcm2",),
    "J/m2": ("jm2",),
    "kJ/m2": ("kjm2",),
    "MJ/m2": ("mjm2",),
    "J/cm2": ("jcm2",),
    "Wh/m2": ("whm2", "whrm2"),
    "kWh/m2": ("kwhm2", "kwhrm2"),
    "umol/m2/s": ("umolm2s", "umolm2s1", "umolsm2", "umols1m2", "umol", "ue", "uem2s", "uem2s1",
                  "ueinstein", "ueinsteinm2s", "ueinsteinm2s1", "umolphotonsm2s",
                  "umolphotonsm2s1", "micromolm2s", "micromolm2s1", "micromolesm2s", "umolesm2s",
                  "ppfd"),
    "mmol/m2/s": ("mmolm2s", "mmolm2s1"),
    "mol/m2/d": ("molm2d", "molm2d1", "molm2day", "molm2day1"),
    "cal/cm2": ("calcm2", "ly", "langley", "langleys"),
    "cal/cm2/min": ("calcm2min", "calcm2min1", "lymin", "lymin1", "langleymin"),
    "mol/m2": ("molm2", "mol"),
    "lx": ("lx", "lux"),
    "klx": ("klx", "klux"),
    "mmol/m2": ("mmolm2",),
}  # fmt: skip
KNOWN = {spelling: unit for unit, spellings in SPELLINGS.items() for spelling in spellings}
OTHER_UNITS = {"nm", "um", "m", "mm", "cm", "s", "min", "h", "degc", "c", "%", "ts", "rn", "v",
               "mv", "volts", "deg", "utc", "hpa", "einstein", "einsteins",
               "candela", "candelas", "footcandle", "footcandles", "millivolt", "millivolts",
               "counts", "kilojoules", "megajoules"}  # fmt: skip


ILLUMINANCE = (
    "Light as the eye sees it tells radiation under one kind of light alone: `{key}: {unit}` takes "
    f"it for daylight, of which 1000 lx are {1e3 / DAYLIGHT_LX_PER_UMOL:.3g} µmol m⁻² s⁻¹ of PAR "
    f"(Thimijan and Heins 1983) and {1e3 / DAYLIGHT_LM_PER_W:.2g} W m⁻² (Littlefair 1985)."
)


def named(text: str) -> str | None:
    """The unit of light that a text spells, or None.

    `W m⁻²`, `W/m^2`, `global_W_m2` and `Wm-2` are W/m2; `uE`, `µmol m-2 s-1` and `par_umolm2s` are
    umol/m2/s.
    """
    squeezed = _squeezed(text)
    if squeezed in KNOWN:
        return KNOWN[squeezed]
    words = re.split(r"[_\s,;]+", text.strip())
    for start in range(1, len(words)):  # the unit at the end of a name
        tail = _squeezed("".join(words[start:]))
        if tail in KNOWN and len(tail) > 1:
            return KNOWN[tail]
    return None


def is_unit(text: str) -> bool:
    """Whether a text is a unit and nothing else."""
    squeezed = _squeezed(text)
    return squeezed in KNOWN or squeezed in OTHER_UNITS or text.strip() == "°C"


def of_column(
    in_file: str, column: str, declared: str, *, where: str, key: str, known: Sequence[str]
) -> tuple[str, list[Finding]]:
    """The unit of a column: the declared one, that of cells or header, or that of its name.

    Parameters
    ----------
    in_file : str
        Unit in the cells or the header, "" where there is none.
    column : str
        Name of the column.
    declared : str
        Unit of the configuration, "" where none is declared.
    where, key : str
        File and column, and key of the configuration, for messages.
    known : sequence of str
        Units that the quantity can have.

    Returns
    -------
    unit : str
        "" where nobody says.
    findings : list of Finding
        A warning where configuration and file disagree; the configuration is followed.

    Raises
    ------
    InputError
        The file has a unit that the quantity cannot have, and none is declared.
    """
    found = named(in_file) if in_file else named(column)
    if declared:
        doubt = findings.warning(
            where, f"the unit {found}", f"{declared}, as `{key}` says", "The key is followed."
        )
        return declared, [doubt] if found and found != declared else []
    if (in_file and found is None) or (found and found not in known):
        is_for_eyes = found in ILLUMINANCES
        raise InputError(
            where,
            f"the unit '{in_file or found}'",
            f"one of {', '.join(known)}",
            ILLUMINANCE.format(key=key, unit=found)
            if is_for_eyes
            else f"Declare it as `{key}`, or convert the values.",
        )
    return found or "", []


def irradiance_factor(unit: str, interval_min: float | None, where: str) -> float:
    """What a value has to be multiplied by to be W m⁻².

    Parameters
    ----------
    unit : str
        A key of `POWERS` or `ENERGIES`.
    interval_min : float or None
        Over which a sum was taken [min].
    where : str
        File and column, for messages.

    Raises
    ------
    InputError
        A sum over an unknown interval, or a unit that is none of irradiance.
    """
    return _factor(unit, POWERS, ENERGIES, interval_min, where)


def like_power(interval_min: float) -> list[str]:
    """Sums over an interval whose numbers are within a fifth of those of W m⁻², but not the same.

    Haze and calibration make as much of a difference, so no check can tell them.
    """
    if not interval_min > 0.0:
        return []
    factors = {unit: joules / (60.0 * interval_min) for unit, joules in ENERGIES.items()}
    return [unit for unit, one in factors.items() if 0.02 < abs(one - 1.0) < 0.2]


def photon_factor(unit: str, interval_min: float | None, where: str) -> float:
    """What a value has to be multiplied by to be µmol m⁻² s⁻¹; see `irradiance_factor`."""
    return _factor(unit, PHOTONS, PHOTON_SUMS, interval_min, where)


def _factor(
    unit: str,
    rates: dict[str, float],
    sums: dict[str, float],
    interval_min: float | None,
    where: str,
) -> float:
    if unit in rates:
        return rates[unit]
    if unit not in sums:
        raise InputError(
            where,
            f"the unit '{unit}'",
            f"one of {', '.join([*rates, *sums])}",
            "Convert the values, or declare their unit.",
        )
    if not interval_min:
        raise InputError(
            where,
            f"sums in {unit} over an unknown interval",
            "the length of the interval",
            "Set `interval_min` for this table.",
        )
    return sums[unit] / (60.0 * interval_min)


def _squeezed(text: str) -> str:
    """A unit without powers' signs, blanks and dots: `µmol m⁻² s⁻¹` is `umolm2s1`."""
    plain = text.strip().lower()
    plain = plain.translate(str.maketrans("µμ²¹", "uu21", "⁻"))
    return re.sub(r"[\s/_.·⋅*^()\[\]-]", "", plain)
