"""Shots predicted from a reconstruction."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

from dapple.config.base import Count, NotNegative, Positive, Section, key


class Rescan(Section):
    """Shots of a scan position predicted from what the other positions show."""

    positions: Count = key(1, "positions that are left out in turn and predicted")
    tolerance_m: Positive = key(0.05, "a first range this near to the measured one is right")
    layers: Count = key(5, "height layers of the crown")
    sub_rays: Annotated[int, Ge(1), Le(64)] = key(7, "rays that sample one beam")
    min_separation_m: NotNegative = key(
        0.8, "nearer targets merge into one mixed return, as in the scanner"
    )
