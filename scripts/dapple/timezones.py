"""Time zones as people name them.

The standard library alone: Snakemake's own process reads this.
"""

import difflib
import re
from datetime import datetime, timedelta, timezone
from zoneinfo import ZoneInfo, available_timezones

from dapple.errors import InputError

ABBREVIATIONS = {
    "z": 0, "ut": 0, "utc": 0, "gmt": 0, "uct": 0, "zulu": 0,
    "mez": 60, "mesz": 120, "cest": 120, "west": 60, "eest": 180, "msk": 180,
    "edt": -240, "cdt": -300, "mdt": -360, "pst": -480, "pdt": -420, "akst": -540, "akdt": -480,
    "nst": -210, "ndt": -150, "adt": -180, "clt": -240, "clst": -180, "brt": -180, "art": -180,
    "jst": 540, "kst": 540, "hkt": 480, "sgt": 480, "awst": 480, "acst": 570, "acdt": 630,
    "aest": 600, "aedt": 660, "nzst": 720, "nzdt": 780, "sast": 120, "wat": 60, "eat": 180,
    "pkt": 300, "ict": 420, "wib": 420,
}  # fmt: skip
"""Minutes east of Greenwich of abbreviations that mean one thing."""

UNCLEAR = {
    "ist": "India +05:30, Israel +02:00 or Ireland +01:00",
    "cst": "Central America -06:00, China +08:00 or Cuba -05:00",
    "bst": "British Summer +01:00 or Bangladesh +06:00",
    "ast": "Atlantic -04:00 or Arabia +03:00",
    "amt": "Amazon -04:00 or Armenia +04:00",
    "wst": "Western Samoa +13:00 or Western Australia +08:00",
}
"""Abbreviations that mean several."""

SUMMER_ZONES = {"CET": "+01:00", "MET": "+01:00", "EET": "+02:00", "WET": "+00:00",
                "EST5EDT": "-05:00", "CST6CDT": "-06:00", "MST7MDT": "-07:00",
                "PST8PDT": "-08:00"}  # fmt: skip
"""Zones of the IANA database that look like a fixed offset and change to summer time."""


def find_timezone(name: str, where: str = "timezone") -> ZoneInfo | timezone:
    """The zone of a name or of an offset.

    Parameters
    ----------
    name : str
        IANA name (`Europe/Berlin`), offset (`+02:00`, `UTC+2`, `GMT-03:30`; east is positive) or
        an abbreviation that means one thing (`MEZ`, `PDT`). Names such as `Etc/GMT+1` keep the
        database's meaning, which is *west* of Greenwich.
    where : str
        File or key to name in errors.

    Raises
    ------
    InputError
        No such zone (the message names the nearest one), or an abbreviation that means several.
    """
    text = str(name).strip()
    known = available_timezones()
    pattern = r"(?:UTC|GMT|UT|Z)?\s*([+\-−])\s*(\d{1,2})(?::?([0-5]\d))?(?:\s*h)?"
    if offset := re.fullmatch(pattern, text, re.IGNORECASE):
        sign, hours, minutes = offset.groups()
        delta = timedelta(hours=int(hours), minutes=int(minutes or 0))
        if delta <= timedelta(hours=14):
            return timezone(delta if sign == "+" else -delta)
    if unsigned := re.fullmatch(r"(?:UTC|GMT|UT)?\s*(\d{1,2})", text, re.IGNORECASE):
        hours = int(unsigned[1])
        raise InputError(
            where, f"the time zone '{name}'", "an offset with its sign",
            f"Write '+{hours:02d}:00' where clocks are ahead of Greenwich, else '-{hours:02d}:00'.",
        )  # fmt: skip
    if (unclear := UNCLEAR.get(text.lower())) and text not in known:
        raise InputError(
            where, f"the time zone '{name}'", f"one of several: {unclear}", "Write its offset."
        )
    if text in known and text.upper() not in ("UTC", "GMT", "UCT", "ZULU"):
        return ZoneInfo(text)
    if (minutes := ABBREVIATIONS.get(text.lower())) is not None:
        return ZoneInfo("UTC") if minutes == 0 else timezone(timedelta(minutes=minutes))
    by_lower = {zone.lower(): zone for zone in known}
    close = difflib.get_close_matches(text.lower(), by_lower, n=1, cutoff=0.4)
    remedy = f"Did you mean '{by_lower[close[0]]}'?" if close else "Use UTC if times are in UTC."
    raise InputError(
        where,
        f"unknown time zone '{name}'",
        "an IANA name such as Europe/Berlin, or UTC, or an offset such as +02:00",
        remedy,
    )


def offset_of_hours(hours: float) -> str:
    """The name of an offset from hours east of Greenwich: 5.5 is +05:30."""
    whole, minutes = divmod(round(60 * abs(hours)), 60)
    return f"{'-' if hours < 0 else '+'}{whole:02d}:{minutes:02d}"


def is_same(one: str, other: str) -> bool:
    """Whether two names of zones mean one offset in January and in July."""
    zones = (find_timezone(one), find_timezone(other))
    days = (datetime(2023, 1, 1), datetime(2023, 7, 1))
    return len({tuple(zone.utcoffset(day) for day in days) for zone in zones}) == 1


def note(name: str | None) -> str:
    """What a user may not expect of a zone, in a sentence, or ""."""
    text = str(name or "").strip()
    if text in SUMMER_ZONES:
        return (
            f"'{text}' changes to summer time; a clock that stays on winter time all year is "
            f"'{SUMMER_ZONES[text]}'"
        )
    if turned := re.fullmatch(r"Etc/GMT([+-])(\d{1,2})", text):
        side, sign = ("west", "-") if turned[1] == "+" else ("east", "+")
        return (
            f"'{text}' is {int(turned[2])} h {side} of Greenwich ({sign}{int(turned[2]):02d}:00): "
            "signs are turned round in this family of names"
        )
    return ""
