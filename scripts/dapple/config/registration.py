"""Frame and clock of the records."""

from __future__ import annotations

from typing import Literal

from dapple.config.base import NotNegative, Section, Share, key


class Registration(Section):
    """Origin of the tree's frame and offset of the loggers' clock."""

    fit: bool = key(False, "fit them on a part of the records and report on the rest")
    origin_m: tuple[float, float, float] | None = key(
        None,
        "origin of a frame that is unknown, or first guess of it; none: the cloud's own, else 0",
    )
    max_shift_m: NotNegative = key(0.4, "largest shift that is tried, east and north")
    max_clock_offset_s: NotNegative = key(
        60.0,
        "largest clock offset that is tried; a wrong shift can stand in for one",
    )
    gain: Literal["none", "site"] = key(
        "none", "factor on sun and sky, fitted to fitting sensors while they see the whole sun"
    )
    split: Literal["sensor", "time"] = key(
        "sensor", "what is divided into fitting and reporting parts"
    )
    fit_share: Share = key(0.5, "share of it used for fitting")
