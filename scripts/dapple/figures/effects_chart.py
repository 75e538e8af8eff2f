"""What each refinement of the light changes and costs: one line for every coarser level."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from dapple.figures import style

NAMES = {
    "sun": "sun as a {}",
    "sky_patches": "sky patches: {}",
    "sky": "{} sky",
    "max_orders": "scattering orders: {}",
    "ground": "{} ground",
    "bands": "bands: {}",
    "step_min": "sun every {} min",
    "polygon_size_m": "polygons in {} m voxels",
    "surfel_spacing_m": "surfels {} m apart",
    "voxel_size_m": "turbid voxels of {} m",
    "wood": "wood {}",
}
LEFT_OUT, KEPT, GEOMETRY = "#0072B2", "#D55E00", "#8C8C8C"
SMALLEST = 1e-5
"""Effects below are drawn here."""


def of_run(inputs: Mapping[str, Any], options: Mapping[str, Any]) -> Figure:
    """From the files of a run: `advice`."""
    return draw(yaml.safe_load(Path(inputs["advice"]).read_text()))


@style.styled
def draw(facts: dict) -> Figure:
    """Effects beside costs, coarser levels only.

    Parameters
    ----------
    facts : dict
        The contents of `advice.yaml`.
    """
    rows = list(_rows(facts))
    figure = style.new_figure(8.6, 1.1 + 0.2 * len(rows))
    effects, costs = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    for place, (_, colour, effect, cost) in enumerate(reversed(rows)):
        effects.plot([SMALLEST, effect], [place, place], color=colour, linewidth=1)
        effects.plot([effect], [place], "o", color=colour, markersize=5)
        effects.annotate(
            f"{100 * effect:.2g} %",
            (effect, place),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
        costs.barh(place, cost, color=colour, height=0.6)
        costs.text(cost + 0.02, place, f"{100 * cost:.0f} %", va="center", fontsize=7.5)
    effects.axvline(facts["tolerance"], color="#222222", linewidth=0.8, linestyle=(0, (4, 3)))
    effects.text(facts["tolerance"], len(rows) - 0.3, " tolerance", fontsize=7.5, ha="left")
    effects.set(
        xscale="log",
        xlim=(SMALLEST, 3),
        ylim=(-0.7, len(rows) + 0.3),
        xlabel="change of PAR against the finest, share of open-sky PAR (RMSE)",
    )
    effects.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:g} %"))
    effects.set_yticks(range(len(rows)), [row[0] for row in reversed(rows)])
    costs.axvline(1, color="#222222", linewidth=0.8)
    costs.set(xlabel="processor time, share of the finest's", xlim=(0, None))
    costs.grid(axis="y", visible=False)
    _legend(effects)
    return figure


def _rows(facts: dict):
    """Label, colour, effect and relative cost of every level but the finest."""
    for group in ("refinements", "geometry"):
        for name, levels in facts[group].items():
            finest = next(one for one in levels if one["rmse_rel"] == 0)
            chosen = facts["chosen"].get(name)
            for one in levels:
                if one is finest:
                    continue
                no_choice = group == "geometry" or (
                    name == "step_min" and one["level"] <= facts["run_step_min"]
                )
                colour = LEFT_OUT if one["level"] == chosen else KEPT
                colour = GEOMETRY if no_choice else colour
                effect = max(one["effect_rel"], SMALLEST)
                label = NAMES[name].format(one["level"])
                yield label, colour, effect, one["cpu_s"] / finest["cpu_s"]


def _legend(axes: Axes) -> None:
    for colour, label in (
        (LEFT_OUT, "advised"),
        (KEPT, "too coarse, or saves nothing"),
        (GEOMETRY, "not a choice: geometry, the series' own times"),
    ):
        axes.plot([], [], "o-", color=colour, markersize=5, linewidth=1, label=label)
    axes.legend(loc="upper center", bbox_to_anchor=(0.6, 1.09), ncols=3, fontsize=7.5)
