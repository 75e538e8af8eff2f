"""Time zones by name. The standard library alone: Snakemake's own process reads this."""

import difflib
import re
from datetime import timedelta, timezone
from zoneinfo import ZoneInfo, available_timezones

from dapple.errors import InputError


def find_timezone(name: str, where: str = "timezone") -> ZoneInfo | timezone:
    """The zone of an IANA name (`Europe/Berlin`) or of an offset (`+02:00`).

    Raises
    ------
    InputError
        No such zone; the message names the nearest one.
    """
    if offset := re.fullmatch(r"([+-])(\d\d):(\d\d)", str(name)):
        sign, hours, minutes = offset.groups()
        delta = timedelta(hours=int(hours), minutes=int(minutes))
        if delta < timedelta(hours=24):
            return timezone(-delta if sign == "-" else delta)
    known = available_timezones()
    if name in known:
        return ZoneInfo(name)
    by_lower = {zone.lower(): zone for zone in known}
    close = difflib.get_close_matches(str(name).lower(), by_lower, n=1, cutoff=0.4)
    remedy = f"Did you mean '{by_lower[close[0]]}'?" if close else "Use UTC if times are in UTC."
    raise InputError(
        where,
        f"unknown time zone '{name}'",
        "an IANA name such as Europe/Berlin, or UTC, or an offset such as +02:00",
        remedy,
    )
