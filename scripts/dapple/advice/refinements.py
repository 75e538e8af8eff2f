"""How finely light has to be computed: what each refinement changes and costs on a pilot."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats.netcdf import times
from dapple.frames import direction_from_angles
from dapple.light import light_model, series, visibility
from dapple.light.light_model import PARTS, Cost, Effort, Model
from dapple.light.series import Light
from dapple.scene.scene_optics import Optics
from dapple.scene.traced import TracedScene
from dapple.sky.sun import position

LEVELS = {
    "sun": ("point", "disc"),
    "sky_patches": (1, 145, 577, 2305),
    "sky": ("isotropic", "perez"),
    "max_orders": (0, 1, 2),
    "ground": ("black", "lambertian"),
    "bands": (1, 3),
}
"""What is tried of each refinement; the finest model adds its own `max_orders` and all bands."""
STEPS_MIN = (1, 2, 5, 10, 30)
WINDOW_MIN = 360
"""Longest part of the series in which time steps are compared, from its middle."""


@dataclass(frozen=True)
class Effect:
    """What one refinement changes and costs on the pilot.

    Attributes
    ----------
    refinement, level : str and its value
        A field of `Model`, or of geometry.
    rmse_rel, bias_rel : float
        Against the finest, of differences divided by open-sky PAR of their time.
    noise_rel : float
        Part of the RMSE that random numbers alone would make; 0 where both share them.
    parts : dict of str to Cost
        What each of `PARTS` cost in this very run.
    rmse_truth_rel, bias_truth_rel : float or None
        Against the light of the truth, where there is one.
    """

    refinement: str
    level: str | float
    rmse_rel: float
    bias_rel: float
    noise_rel: float
    parts: dict[str, Cost] = field(default_factory=dict)
    rmse_truth_rel: float | None = None
    bias_truth_rel: float | None = None

    @property
    def effect_rel(self) -> float:
        """RMSE without the noise."""
        return float(np.sqrt(max(self.rmse_rel**2 - self.noise_rel**2, 0.0)))

    @property
    def cost(self) -> Cost:
        """Of all parts together."""
        return sum(self.parts.values(), Cost())


def rows(effects: list[Effect]) -> dict[str, list[dict]]:
    """Effects by refinement as plain values, for a file."""
    found: dict[str, list[dict]] = {}
    for effect in effects:
        row = {
            "level": effect.level,
            "effect_rel": effect.effect_rel,
            "rmse_rel": effect.rmse_rel,
            "bias_rel": effect.bias_rel,
            "noise_rel": effect.noise_rel,
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


class Pilot:
    """Light of a few sensors at a few times, each model computed as often as the clock needs.

    Parameters
    ----------
    sensors_m : (n, 3) float64
        Local frame [m].
    sky : xarray.Dataset
        Sun and sky at the times of the pilot, in daylight.
    optics : Optics
    finest : Model
        What all is compared with.
    effort : Effort
    repeats : int
        The shortest of so many runs is what a model costs: others share the machine.
    seed : int
    """

    def __init__(
        self,
        sensors_m: np.ndarray,
        sky: xr.Dataset,
        optics: Optics,
        *,
        finest: Model,
        effort: Effort,
        repeats: int,
        seed: int,
    ):
        self.sensors_m, self.sky, self.optics = sensors_m, sky, optics
        self.finest, self.effort = finest, effort
        self.repeats, self.seed = repeats, seed
        self.open_sky = series.open_sky_par(sky).to_numpy()

    def light(self, scene: TracedScene, model: Model) -> tuple[Light, dict[str, Cost]]:
        """Light of a model and its cost with kernels that are compiled already."""
        runs = [
            light_model.light(
                scene,
                self.sensors_m,
                self.sky,
                self.optics,
                model,
                self.effort,
                seed=self.seed,
            )
            # One more than asked for: the first may compile kernels.
            for _ in range(self.repeats + 1)
        ][1:]
        best = {part: light_model.least([costs[part] for _, costs in runs]) for part in PARTS}
        return runs[-1][0], best

    def difference(self, one: Light, other: Light) -> tuple[float, float]:
        """RMSE and bias of the first against the second, on the scale of the open sky."""
        relative = (one.par - other.par) / self.open_sky
        return float(np.sqrt((relative**2).mean())), float(relative.mean())

    def noise(self, one: Light, other: Light) -> float:
        """RMSE that two lights of the same scene would have by their random numbers alone."""
        errors = np.hypot(one.standard_error, other.standard_error) / self.open_sky
        return float(np.sqrt((errors**2).mean()))

    def effect(
        self,
        refinement: str,
        level: str | float,
        found: tuple[Light, dict[str, Cost]],
        finest: Light,
        *,
        truth: Light | None,
        shared: bool,
    ) -> Effect:
        """Compare one light with the finest and with the truth."""
        result, parts = found
        against_truth = (None, None) if truth is None else self.difference(result, truth)
        noise = 0.0 if shared else self.noise(result, finest)
        return Effect(
            refinement, level, *self.difference(result, finest), noise, parts, *against_truth
        )


def model_effects(
    one: Pilot, scene: TracedScene, *, truth: Light | None = None
) -> tuple[list[Effect], Light]:
    """Every level of every refinement of the model, one at a time against the finest.

    Parameters
    ----------
    one : Pilot
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
    finest = one.light(scene, one.finest)
    effects = []
    for refinement, levels in LEVELS.items():
        best = getattr(one.finest, refinement)
        coarser = [level for level in levels if level != best and _is_coarser(level, best)]
        for level in coarser:
            found = one.light(scene, replace(one.finest, **{refinement: level}))
            # The seed makes models share their paths, so that their differences have no noise.
            effects.append(
                one.effect(refinement, level, found, finest[0], truth=truth, shared=True)
            )
        effects.append(one.effect(refinement, best, finest, finest[0], truth=truth, shared=True))
    return effects, finest[0]


def _is_coarser(level: str | float, best: str | float) -> bool:
    return isinstance(level, str) or level < best


def step_effects(
    one: Pilot, scene: TracedScene, series_sky: xr.Dataset, *, seed: int
) -> list[Effect]:
    """Time steps of the direct beam, interpolated, against one minute.

    Parameters
    ----------
    one : Pilot
        For its sensors, effort and sun.
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
    sun = position(fine, *place)
    suns = direction_from_angles(sun["sun_zenith_deg"], sun["sun_azimuth_deg"])
    share_of_beam = _share_of_beam(series_sky, stamps, fine)
    options = {
        "tolerance": one.effort.shadow_tolerance,
        "max_rays": one.effort.max_shadow_rays,
        "sun_diameter_deg": one.effort.sun_diameter_deg,
        "aperture_m": one.effort.aperture_m,
        "seed": seed,
    }
    minutes = np.arange(window + 1)
    seen = visibility.sunlit(scene, one.sensors_m, suns, **options).share.mean(axis=0)
    effects = []
    for step in sorted(STEPS_MIN, reverse=True):
        known = minutes[::step]
        runs = [
            light_model.timed(
                lambda known=known: visibility.sunlit(scene, one.sensors_m, suns[known], **options)
            )[1]
            for _ in range(one.repeats)
        ]
        between = np.array([np.interp(minutes, known, row[known]) for row in seen])
        error = (between - seen) * share_of_beam
        rmse, bias = float(np.sqrt((error**2).mean())), float(error.mean())
        effects.append(
            Effect("step_min", step, rmse, bias, 0.0, {"direct": light_model.least(runs)})
        )
    return effects


def _share_of_beam(
    sky: xr.Dataset, stamps: pd.DatetimeIndex, wanted: pd.DatetimeIndex
) -> np.ndarray:
    """Direct light on the level as a share of open-sky PAR."""
    total = series.open_sky_par(sky).to_numpy()
    diffuse = sky["diffuse_horizontal_umol_m2_s"].sum("band").to_numpy()
    share = np.where(total > 0, 1 - diffuse / np.where(total > 0, total, 1), 0)
    return np.interp(wanted.as_unit("ns").asi8, stamps.as_unit("ns").asi8, share)


def geometry_effects(
    one: Pilot,
    refinement: str,
    scenes: Iterable[tuple[str | float, Callable[[], TracedScene]]],
    *,
    truth: Light | None = None,
) -> list[Effect]:
    """Geometries of one kind against the first of them, the finest.

    Parameters
    ----------
    one : Pilot
    refinement : str
    scenes : iterable of (level, callable)
        Each gives its scene when it is needed, the finest first.
    truth : Light or None
    """
    effects, finest = [], None
    for level, load in scenes:
        found = one.light(load(), one.finest)
        finest = found[0] if finest is None else finest
        effects.append(
            one.effect(refinement, level, found, finest, truth=truth, shared=found[0] is finest)
        )
    return effects
