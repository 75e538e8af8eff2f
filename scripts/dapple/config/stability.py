"""The stability map."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

from dapple.config.base import Count, Section, key


class Stability(Section):
    """Where reconstructions fail: one thing at a time made worse in virtual worlds."""

    stressors: tuple[str, ...] = key((), "stressors to apply; empty: all")
    levels: Annotated[int, Ge(2)] = key(6, "most levels of each stressor")
    seeds: Count = key(3, "worlds for each level")
    reconstructions: tuple[str, ...] = key((), "what to rebuild; empty: all")
    bands: Annotated[int, Ge(1), Le(3)] = key(3, "groups of bands, traced together")
    truth_factor: Count = key(4, "how many times more rays the true world gets")
