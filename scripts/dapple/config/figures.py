"""Pictures."""

from __future__ import annotations

from dapple.config.base import Moment, NotNegative, Positive, Section, key


class Figures(Section):
    """Pictures."""

    sensors: tuple[str, ...] = key((), "sensors of the daily courses; empty: six spread ones")
    map_times: tuple[Moment, ...] = key(
        (), "times of the figure of ground maps; empty: four spread ones"
    )
    map_spacing_m: Positive = key(0.25, "pixel of the ground maps, more where they were very large")
    map_margin_m: NotNegative = key(2.0, "ground shown beyond the crown and its shadows")
