"""The times of a run."""

from __future__ import annotations

from dapple.config.base import FREY, Moment, Positive, Section, key


class Time(Section):
    """The times to be simulated."""

    start: Moment = key("2023-08-10 10:10", "first time", FREY)
    end: Moment = key("2023-08-10 16:50", "last time", FREY)
    step_min: Positive = key(10.0, "minutes between times")
    timezone: str = key("UTC", "IANA zone of start and end")
