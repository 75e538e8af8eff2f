"""How finely light has to be computed: what each refinement changes and costs on a pilot."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple import steps
from dapple.advice.costs import repeated, work_of_sun
from dapple.advice.pilot import Effect, Pilot
from dapple.formats.netcdf import time_coordinate, times
from dapple.light.series import Light
from dapple.light.visibility import Sunlit
from dapple.optics.responses import Response
from dapple.scene.traced import TracedScene
from dapple.sky.open_sky import open_diffuse, open_sky_par
from dapple.sky.sun import position

LEVELS = {
    "sun": ("point", "disc"),
    "sky_patches": (1, 145, 577, 2305),
    "sky": ("isotropic", "as given"),
    "max_orders": (0, 1, 2),
    "ground": ("black", "lambertian"),
    "bands": (1, 3),
}
"""What is tried of each refinement; the finest model adds its own `max_orders` and all bands."""
STEPS_MIN = (1, 2, 5, 10, 30)
WINDOW_MIN = 360
"""Longest part of the series in which time steps are compared, from its middle."""


def rows(effects: list[Effect]) -> dict[str, list[dict]]:
    """Effects by refinement as plain values, for a file."""
    found: dict[str, list[dict]] = {}
    for effect in effects:
        row: dict[str, Any] = {
            "level": effect.level,
            "effect_rel": effect.effect_rel,
            "rmse_rel": effect.rmse_rel,
            "bias_rel": effect.bias_rel,
            "noise_rel": effect.noise_rel,
            "work_s": effect.cost.work_s,
            "wall_s": effect.cost.wall_s,
            "cpu_s": effect.cost.cpu_s,
            "wall_s_of": {part: cost.wall_s for part, cost in effect.parts.items()},
        }
        if effect.rmse_truth_rel is not None:
            row["rmse_truth_rel"] = effect.rmse_truth_rel
            row["bias_truth_rel"] = effect.bias_truth_rel
        found.setdefault(effect.refinement, []).append(row)
    return found


def rounded(value: Any, digits: int = 4) -> Any:
    """Plain numbers of a few digits, in lists and dictionaries of any depth."""
    if isinstance(value, dict):
        return {key: rounded(one, digits) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(one, digits) for one in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{digits}g}")
    return value


def model_effects(
    pilot: Pilot, scene: TracedScene, *, truth: Light | None = None
) -> tuple[list[Effect], Light]:
    """Every level of every refinement of the model, one at a time against the finest.

    Parameters
    ----------
    pilot : Pilot
    scene : TracedScene
    truth : Light or None
        Of the same sensors and times.

    Returns
    -------
    list of Effect
        The last of each refinement is the finest itself, whose RMSE is 0.
    Light
        Of the finest model.
    """
    finest = pilot.light(scene, pilot.finest)
    effects = []
    for refinement, levels in LEVELS.items():
        best = getattr(pilot.finest, refinement)
        coarser = [level for level in levels if level != best and _is_coarser(level, best)]
        for level in coarser:
            change: dict[str, Any] = {refinement: level}
            found = pilot.light(scene, replace(pilot.finest, **change))
            # The seed makes models share their paths, so that their differences have no noise.
            effects.append(
                pilot.effect(refinement, level, found, finest[0], truth=truth, shared=True)
            )
        effects.append(pilot.effect(refinement, best, finest, finest[0], truth=truth, shared=True))
    return effects, finest[0]


def _is_coarser(level: Any, best: Any) -> bool:
    return isinstance(level, str) or level < best


def step_effects(
    pilot: Pilot, scene: TracedScene, series_sky: xr.Dataset, *, seed: int
) -> list[Effect]:
    """Time steps of the direct beam, interpolated, against one minute.

    Parameters
    ----------
    pilot : Pilot
        For its sensors, and how its rays are traced.
    scene : TracedScene
    series_sky : xarray.Dataset
        The whole series; its light between its times is interpolated.
    seed : int

    Returns
    -------
    list of Effect
        From the longest step to one minute; none for a series shorter than the longest step. The
        cost is that of the direct beam alone.
    """
    stamps = times(series_sky)
    length = (stamps[-1] - stamps[0]).total_seconds() / 60
    longest = max(STEPS_MIN)
    window = int(min(length, WINDOW_MIN) // longest) * longest
    if not window:
        return []
    start = stamps[0] + pd.Timedelta(minutes=(length - window) / 2)
    fine = pd.date_range(start, periods=window + 1, freq="1min")
    place = (series_sky.attrs[name] for name in ("latitude_deg", "longitude_deg", "altitude_m"))
    suns = xr.Dataset(
        {name: ("time", values) for name, values in position(fine, *place).items()},
        coords={"time": time_coordinate(fine)},
    )
    share_of_beam = _share_of_beam(series_sky, stamps, fine, pilot.tracing.response)

    def visible(known: np.ndarray) -> Sunlit:
        """The sun at some of the minutes, each of them traced."""
        every = replace(pilot.finest, step_min=0.0)
        there = suns.isel(time=known)
        return steps.sun(
            scene, pilot.sensors_m, there, every, pilot.tracing, facing=pilot.facing, seed=seed
        )

    minutes = np.arange(window + 1)
    seen = visible(minutes).share.mean(axis=0)
    effects = []
    for step in sorted(STEPS_MIN, reverse=True):
        known = minutes[::step]
        found, cost = repeated(partial(visible, known), pilot.repeats)
        between = np.array([np.interp(minutes, known, row[known]) for row in seen])
        error = (between - seen) * share_of_beam
        rmse, bias = float(np.sqrt((error**2).mean())), float(error.mean())
        effects.append(
            Effect("step_min", step, rmse, bias, 0.0, {"direct": cost.of(work_of_sun(found))})
        )
    return effects


def _share_of_beam(
    sky: xr.Dataset, stamps: pd.DatetimeIndex, wanted: pd.DatetimeIndex, response: Response
) -> np.ndarray:
    """Direct light as a share of what sensors read under the open sky."""
    total = open_sky_par(sky, response).to_numpy()
    diffuse = open_diffuse(sky, response)
    share = np.where(total > 0, 1 - diffuse / np.where(total > 0, total, 1), 0)
    return np.interp(wanted.as_unit("ns").asi8, stamps.as_unit("ns").asi8, share)


def geometry_effects(
    pilot: Pilot,
    refinement: str,
    scenes: Iterable[tuple[str | float, Callable[[], TracedScene]]],
    *,
    truth: Light | None = None,
) -> list[Effect]:
    """Geometries of one kind against the first of them, the finest.

    Parameters
    ----------
    pilot : Pilot
    refinement : str
    scenes : iterable of (level, callable)
        Each gives its scene when it is needed, the finest first.
    truth : Light or None
    """
    effects: list[Effect] = []
    finest = None
    for level, load in scenes:
        found = pilot.light(load(), pilot.finest)
        finest = found[0] if finest is None else finest
        effects.append(
            pilot.effect(refinement, level, found, finest, truth=truth, shared=found[0] is finest)
        )
    return effects
