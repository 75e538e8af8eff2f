"""Configuration of the stability map."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

from dapple.config.base import Count, Section
from dapple.config.base import parameter as _


class Stability(Section):
    """Where methods fail: one thing at a time made worse in virtual worlds."""

    enabled: bool = _(False, "draw the stability map instead of computing light")
    stressors: tuple[str, ...] = _((), "stressors to apply; empty: all")
    levels: Annotated[int, Ge(2)] = _(6, "most levels of each stressor")
    seeds: Count = _(3, "worlds for each level")
    reconstructions: tuple[str, ...] = _((), "methods to run; empty: all")
    bands: Annotated[int, Ge(1), Le(3)] = _(3, "groups of bands, traced together")
    truth_factor: Count = _(4, "how many times more rays the true world gets")
