"""What each refinement of the light changes and costs on a pilot, and what may be left out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from dapple.advice import cheapest, refinements
from dapple.advice.geometries import Geometry
from dapple.advice.pilot import Effect, Pilot
from dapple.formats.netcdf import times
from dapple.light.light_model import Model
from dapple.light.series import Light
from dapple.scene import traced
from dapple.scene.surfaces import LEAF, Scene

LADDERS = {"polygon_size_m": "polygons", "surfel_spacing_m": "surfels", "voxel_size_m": "voxels"}
"""Kinds of geometry by the name of what is refined in them."""


def advise(
    pilot: Pilot,
    base: Scene,
    series_sky: xr.Dataset,
    *,
    n_sensors: int,
    tolerance: float,
    truth: Light | None,
    variant: str,
) -> tuple[dict[str, Any], Model]:
    """Measure the refinements of the model and choose among them.

    Parameters
    ----------
    pilot : Pilot
    base : Scene
        In which the refinements are tried.
    series_sky : xarray.Dataset
        Sun and sky of the whole run.
    n_sensors : int
        Of the whole run.
    tolerance : float
        What may be left out in all, as a share of open-sky PAR.
    truth : Light or None
        The pilot's light under the true plant.
    variant : str
        Of Mitsuba.

    Returns
    -------
    facts : dict
        `tolerance`, `run_step_min`, `chosen`, `left_out_rel`, `measured_rel`, `run_cost_s` and
        `refinements`, plain values for a file.
    model : Model
        The one that is chosen.
    """
    loaded, stamps = traced.load(base, variant), times(series_sky)
    step_min = np.diff(stamps).min().total_seconds() / 60 if len(stamps) > 1 else 0.0
    effects, finest = refinements.model_effects(pilot, loaded, truth=truth)
    effects += refinements.step_effects(pilot, loaded, series_sky, seed=pilot.seed)
    scale = cheapest.Scale.between(
        (len(pilot.sensors_m), pilot.sky.sizes["time"]), (n_sensors, len(stamps))
    )
    best = replace(pilot.finest, step_min=step_min)

    def measured(model: Model) -> float:
        light, _ = pilot.light(loaded, replace(model, step_min=0.0))
        return pilot.difference(light, finest)[0]

    found = cheapest.choose(effects, best, tolerance=tolerance, scale=scale, measure=measured)
    costs = {
        name: cheapest.predicted(effects, best, model, scale)
        for name, model in (("finest", best), ("chosen", found.model))
    }
    facts = {
        "tolerance": tolerance,
        "run_step_min": step_min,
        "chosen": found.model.as_dict(),
        "left_out_rel": found.effects_rel,
        "measured_rel": found.measured_rel,
        "run_cost_s": {
            name: {"work_s": cost.work_s, "wall_s": cost.wall_s, "cpu_s": cost.cpu_s}
            for name, cost in costs.items()
        },
        "refinements": refinements.rows(effects),
    }
    return facts, found.model


def geometry_effects(
    pilot: Pilot,
    base: Scene,
    geometries: Sequence[Geometry],
    *,
    truth: Light | None,
    variant: str,
) -> list[Effect]:
    """Polygons, surfels and voxels of all sizes, and the tree without its wood."""

    def loading(scene_of):
        return lambda: traced.load(scene_of(), variant)

    ladders: dict[str, list[tuple[Any, Any]]] = {
        name: [(one.size_m, loading(one.load)) for one in geometries if one.kind == kind]
        for name, kind in LADDERS.items()
    }
    bare = Scene(base.of(LEAF), None, base.ground_z_m)
    ladders["wood"] = [("present", loading(lambda: base)), ("absent", loading(lambda: bare))]
    found = []
    for name, ladder in ladders.items():
        found += refinements.geometry_effects(pilot, name, ladder, truth=truth)
        print(f"{name} measured", flush=True)
    return found


def notes(geometries: Sequence[Geometry], facts: dict[str, Any], *, has_truth: bool) -> list[str]:
    """What could not be measured."""
    kinds = {one.kind for one in geometries}
    found = []
    if "polygons" not in kinds:
        found.append("no cloud, so that no polygons of other sizes")
    if "voxels" not in kinds:
        found.append("no shots, so that no voxels")
    if not has_truth:
        found.append("the truth is not known")
    found.append("steps up to run_step_min are no choice: those times are traced anyway")
    if "step_min" not in facts["refinements"]:
        found.append("the series is shorter than the longest time step: no time steps compared")
    return found
