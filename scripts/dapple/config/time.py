"""The times of a run."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

from dapple.config.base import FREY, Moment, Section, key


class Time(Section):
    """The times to be simulated."""

    start: Moment = key("2023-08-10 10:10", "first time", FREY)
    end: Moment = key("2023-08-10 16:50", "last time", FREY)
    step_min: Annotated[float, Ge(0.01), Le(527_040)] = key(10.0, "minutes between times")
    timezone: str = key("UTC", "IANA zone of start and end")
