"""The cheapest model of the light that leaves out no more than a tolerance."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from dapple.advice.costs import PARTS, Cost
from dapple.advice.pilot import Effect
from dapple.light.light_model import Model

SAVES = {
    "sun": ("direct",),
    "step_min": ("direct",),
    "sky_patches": ("paths", "products"),
    "max_orders": ("paths", "products"),
    "bands": ("products",),
}
"""Which parts a refinement can make cheaper; what saves nothing (sky, ground) is never left out."""
LEAST_SAVING = 0.1
"""Savings of less than this share are not worth an error."""


@dataclass(frozen=True)
class Cheapest:
    """The cheapest model within the tolerance.

    Attributes
    ----------
    model : Model
    effects_rel : float
        Sum of the effects of what it leaves out.
    measured_rel : float
        RMSE of its light on the pilot against the finest.
    """

    model: Model
    effects_rel: float
    measured_rel: float


@dataclass(frozen=True)
class Scale:
    """How much larger the run is than the pilot: factors on the cost of each of `PARTS`."""

    direct: float
    paths: float
    products: float

    @classmethod
    def between(cls, pilot_size: tuple[int, int], run_size: tuple[int, int]) -> "Scale":
        """From numbers of sensors and times."""
        sensors = run_size[0] / pilot_size[0]
        pairs = sensors * run_size[1] / pilot_size[1]
        return cls(pairs, sensors, pairs)


def predicted(effects: list[Effect], finest: Model, model: Model, scale: Scale) -> Cost:
    """What the whole run costs with a model, from the costs of its levels one at a time.

    Each level makes a part cheaper by the factor by which it did so on the pilot, in counted work.
    """
    total = Cost()
    base = next(e for e in effects if e.refinement == "sun" and e.level == finest.sun)
    for part in PARTS:
        factor = getattr(scale, part)
        for refinement, own in _by_refinement(effects).items():
            if part not in SAVES.get(refinement, ()):
                continue
            level, best = getattr(model, refinement), getattr(finest, refinement)
            if level != best:
                # The run's own time step need not be one of those that were measured.
                nearest = best if best in own else min(own, key=lambda x: abs(x - best))
                ratio = own[level].parts[part].work_s / own[nearest].parts[part].work_s
                factor *= min(ratio, 1.0)
        total += base.parts[part] * factor
    return total


def _by_refinement(effects: list[Effect]) -> dict[str, dict[str | float, Effect]]:
    found: dict[str, dict[str | float, Effect]] = {}
    for effect in effects:
        found.setdefault(effect.refinement, {})[effect.level] = effect
    return found


def choose(
    effects: list[Effect],
    finest: Model,
    *,
    tolerance: float,
    scale: Scale,
    measure: Callable[[Model], float],
) -> Cheapest:
    """The cheapest model whose left-out effects add up to no more than the tolerance.

    Of models that cost nearly the same the one that leaves out least is taken.

    Parameters
    ----------
    effects : list of Effect
        Of refinements of the model and of the time step; others are ignored. Steps below that of
        the finest model are no choice.
    finest : Model
        Always within the tolerance.
    tolerance : float
        Share of open-sky PAR.
    scale : Scale
        From the pilot to the run.
    measure : callable
        RMSE of a model's light on the pilot: what was added up is checked together. Where it
        exceeds the tolerance the next cheapest model is tried.

    Returns
    -------
    Cheapest
    """
    options = {
        name: {
            level: effect.effect_rel
            for level, effect in levels.items()
            if name != "step_min" or float(level) > finest.step_min
        }
        | {getattr(finest, name): 0.0}
        for name, levels in _by_refinement(effects).items()
        if name in SAVES
    }
    allowed = []
    for levels in product(*options.values()):
        left_out = sum(options[name][level] for name, level in zip(options, levels, strict=True))
        if left_out <= tolerance:
            model = replace(finest, **dict(zip(options, levels, strict=True)))
            cost = predicted(effects, finest, model, scale).work_s
            allowed.append((cost, left_out, model))
    while allowed:
        dearest = min(cost for cost, _, _ in allowed) / (1 - LEAST_SAVING)
        near = [one for one in allowed if one[0] <= dearest]
        _, left_out, model = best = min(near, key=lambda one: (one[1], one[0]))
        allowed.remove(best)
        steps = options.get("step_min", {}).get(model.step_min, 0.0)
        measured = float(np.hypot(measure(model), steps))
        if measured <= tolerance or model == finest:
            return Cheapest(model, left_out, measured)
    return Cheapest(finest, 0.0, 0.0)
