"""What each refinement of the light changes and costs on a pilot, and what may be left out."""

import os
from dataclasses import replace

import numpy as np
import yaml

from dapple.advice import cheapest, refinements
from dapple.clock import label
from dapple.formats import json, netcdf, tables, voxel_grids
from dapple.formats.atomic import atomic
from dapple.light import light_model, series
from dapple.scene import scene_files, scene_optics, traced
from dapple.scene.surfaces import LEAF, WOOD, Scene
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    sky, optics = netcdf.read(inputs.sky), scene_optics.read(inputs.optics)
    table = tables.read(inputs.sensors)
    lit = np.flatnonzero(series.open_sky_par(sky).to_numpy() > 0)
    chosen = light_model.spread(len(table), params.sensors)
    moments = lit[light_model.spread(len(lit), params.times)]
    stamps = netcdf.times(sky)
    step_min = np.diff(stamps).min().total_seconds() / 60 if len(stamps) > 1 else 0.0
    one = refinements.Pilot(
        table[["x_m", "y_m", "z_m"]].to_numpy()[chosen],
        sky.isel(time=moments),
        optics,
        finest=light_model.Model(max_orders=params.max_orders, bands=len(optics)),
        effort=light_model.Effort(
            paths=params.paths,
            sky_rays=params.paths,
            shadow_tolerance=params.shadow_tolerance,
            max_shadow_rays=params.max_shadow_rays,
            sun_diameter_deg=params.sun_diameter_deg,
            aperture_m=params.aperture_m,
            sun_kernel_deg=params.sun_kernel_deg,
        ),
        repeats=params.repeats,
        seed=params.seed,
    )
    base = scene_files.read([inputs.leaves], inputs.wood, params.ground_z_m)[0]
    loaded = traced.load(base, params.variant)
    truth = None
    if inputs.truth:
        true = scene_files.read([inputs.truth[0]], inputs.truth[1], params.ground_z_m)[0]
        truth = one.light(traced.load(true, params.variant), one.finest)[0]
    effects, finest = refinements.model_effects(one, loaded, truth=truth)
    effects += refinements.step_effects(one, loaded, sky, seed=params.seed)
    scale = cheapest.Scale.between((len(chosen), len(moments)), (len(table), len(stamps)))
    best = replace(one.finest, step_min=step_min)
    print("model refinements measured", flush=True)
    found = cheapest.choose(
        effects,
        best,
        tolerance=params.tolerance,
        scale=scale,
        measure=lambda model: one.difference(
            one.light(loaded, replace(model, step_min=0.0))[0], finest
        )[0],
    )
    print(f"chosen: {found}", flush=True)
    geometry = geometry_effects(one, base, inputs, params, truth)
    costs = {
        name: cheapest.predicted(effects, best, model, scale)
        for name, model in (("finest", best), ("chosen", found.model))
    }
    facts = {
        "tolerance": params.tolerance,
        "run_step_min": step_min,
        "chosen": found.model.as_dict(),
        "left_out_rel": found.effects_rel,
        "measured_rel": found.measured_rel,
        "run_cost_s": {
            name: {"wall_s": cost.wall_s, "cpu_s": cost.cpu_s} for name, cost in costs.items()
        },
        "pilot": {
            "sensors": list(table["sensor"].iloc[chosen]),
            "times": [label(stamps[k]) for k in moments],
            "of_sensors": len(table),
            "of_times": len(stamps),
            "variant": params.variant,
            "cores": len(os.sched_getaffinity(0)),
        },
        "refinements": refinements.rows(effects),
        "geometry": refinements.rows(geometry),
        "notes": notes(params, inputs, effects),
    }
    with atomic(snakemake.output.advice) as partial:
        partial.write_text(HEAD + yaml.safe_dump(refinements.rounded(facts), sort_keys=False))
    json.write(snakemake.output.model, found.model.as_dict())


HEAD = """\
# What each refinement of the light changes and costs, one at a time on the pilot.
# rmse_rel, bias_rel: against the finest, as shares of open-sky PAR; noise_rel: what random numbers
# alone would make of it; effect_rel: rmse without noise; truth: against the true plant's light.
# Costs are seconds of this very run with compiled kernels; run_cost_s is predicted for all sensors
# and times.
"""


def geometry_effects(one, base, inputs, params, truth):
    """Polygons and voxels of all sizes, and the tree without its wood."""

    def load(scene):
        return traced.load(scene, params.variant)

    polygons = [
        (
            size,
            lambda leaves=leaves, branches=branches: load(
                scene_files.read([leaves], branches, params.ground_z_m)[0]
            ),
        )
        for size, leaves, branches in zip(
            params.polygon_sizes_m, inputs.sized_leaves, inputs.sized_wood, strict=False
        )
    ]
    turbid = [
        (
            size,
            lambda path=path: load(Scene(base.of(WOOD), voxel_grids.read(path), params.ground_z_m)),
        )
        for size, path in zip(params.voxel_sizes_m, inputs.voxels, strict=False)
    ]
    branches = [
        ("present", lambda: load(base)),
        ("absent", lambda: load(Scene(base.of(LEAF), None, params.ground_z_m))),
    ]
    found = []
    for name, ladder in (
        ("polygon_size_m", polygons),
        ("voxel_size_m", turbid),
        ("wood", branches),
    ):
        found += refinements.geometry_effects(one, name, ladder, truth=truth)
        print(f"{name} measured", flush=True)
    return found


def notes(params, inputs, effects):
    """What could not be measured."""
    found = []
    if not inputs.sized_leaves:
        found.append(f"source: {params.source}: no cloud, so that no polygons of other sizes")
    if not inputs.voxels:
        found.append("no shots, so that no voxels")
    if not inputs.truth:
        found.append("the truth is not known")
    found.append("steps up to run_step_min are no choice: those times are traced anyway")
    if not any(effect.refinement == "step_min" for effect in effects):
        found.append("the series is shorter than the longest time step: no time steps compared")
    return found


if __name__ == "__main__":
    run(main, snakemake)
