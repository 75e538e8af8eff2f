"""The times of a run as its configuration writes them.

The standard library alone: Snakemake's own process reads this, and it may have nothing else.
"""

from datetime import UTC, datetime, timedelta, tzinfo

from dapple.errors import InputError
from dapple.timezones import find_timezone

MOST_TIMES = 1_000_000
"""About two years in steps of a minute."""


def time_range(
    start: str, end: str, step_min: float, timezone: str, where: str = "time"
) -> list[datetime]:
    """Times from `start` to `end`, both included where the step meets them, in UTC.

    Parameters
    ----------
    start, end : str
        ISO 8601, on the clock of `timezone` unless they carry an offset.
    step_min : float
        Minutes between times.
    timezone : str
        Zone of `start` and `end`: IANA name or offset.
    where : str
        The key or file, for messages.

    Raises
    ------
    InputError
        Not a time, an unknown zone, an hour that the clock skips or repeats, no positive step, an
        end before the start, or more than `MOST_TIMES` times.
    """
    zone = find_timezone(timezone, where)
    first, last = (
        _moment(text, zone, f"{where}, {name}") for name, text in (("start", start), ("end", end))
    )
    if last < first or not step_min > 0:
        raise InputError(
            where,
            f"{first} to {last} every {step_min} min",
            "an end after the start and a positive step",
            "Exchange the ends or mend the step.",
        )
    count = 1 + (last - first) // timedelta(minutes=step_min)
    if count > MOST_TIMES:
        raise InputError(
            where,
            f"{count:,} times from {first} to {last} every {step_min:g} min",
            f"no more than {MOST_TIMES:,}",
            "Take a longer step or a shorter span: runs of one year each, for example.",
        )
    return [first + timedelta(minutes=k * step_min) for k in range(count)]


def label(time: datetime) -> str:
    """Name of a time that knows its zone, as in 20230810T101000Z; always UTC."""
    return time.astimezone(UTC).strftime("%Y%m%dT%H%M%SZ")


def _moment(text: str, zone: tzinfo, where: str) -> datetime:
    """A time in UTC; on the clock of the zone unless it has an offset of its own."""
    try:
        moment = datetime.fromisoformat(str(text))
    except ValueError as error:
        raise InputError(
            where, f"{text!r}", "a time such as 2023-08-10 10:10", "Write it in ISO 8601."
        ) from error
    if moment.tzinfo is None:
        if zone.utcoffset(moment) != zone.utcoffset(moment.replace(fold=1)):
            raise InputError(
                where,
                f"{text}, which daylight saving makes ambiguous or skips",
                "a time that the clock shows once",
                "Write it in UTC, or with a fixed offset such as +01:00.",
            )
        moment = moment.replace(tzinfo=zone)
    return moment.astimezone(UTC)
