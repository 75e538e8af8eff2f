"""How simulated and measured light are compared."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Gt, Le

from dapple.config.base import Count, Section, key


class Statistics(Section):
    """How simulated and measured light are compared."""

    n_bootstrap: Count = key(1000, "bootstrap replicates, sensors drawn as blocks")
    confidence: Annotated[float, Gt(0), Le(0.999)] = key(0.95, "level of the intervals")
