"""What each refinement of the light changes and costs on a pilot, and what may be left out."""

import os

import yaml

from dapple.advice import advise, geometries, pilot, refinements
from dapple.clock import label
from dapple.formats import json, netcdf, tables
from dapple.formats.atomic import atomic
from dapple.light.light_model import Model, Tracing
from dapple.scene import scene_files, scene_optics, sensors, traced
from dapple.scene.facing import facing_of
from dapple.workflow import run

HEAD = """\
# What each refinement of the light changes and costs, one at a time on the pilot.
# rmse_rel, bias_rel: against the finest, as shares of open-sky PAR; noise_rel: what random numbers
# alone would make of it; effect_rel: rmse without noise; truth: against the true plant's light.
# work_s: counted rays, surfaces and products at fixed prices, by which the model is chosen; wall_s
# and cpu_s: seconds of this very run with compiled kernels. run_cost_s is predicted for all sensors
# and times.
"""


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    sky, optics = netcdf.read(inputs.sky), scene_optics.read(inputs.optics)
    table, stamps = tables.read(inputs.sensors), netcdf.times(sky)
    chosen = pilot.spread(len(table), params.sensors)
    moments = pilot.daylight_times(sky, params.times)
    one = pilot.Pilot(
        table[sensors.POSITION].to_numpy()[chosen],
        sky.isel(time=moments),
        optics,
        finest=Model(max_orders=params.max_orders, bands=len(optics)),
        tracing=Tracing(**params.tracing),
        repeats=params.repeats,
        facing=facing_of(table.iloc[chosen]),
        seed=params.seed,
    )
    base = scene_files.read([inputs.leaves], inputs.wood, around)[0]
    truth = None
    if inputs.truth:
        true = scene_files.read([inputs.truth[0]], inputs.truth[1], around)[0]
        truth = one.light(traced.load(true, params.variant), one.finest)[0]
    facts, model = advise.advise(
        one,
        base,
        sky,
        n_sensors=len(table),
        tolerance=params.tolerance,
        truth=truth,
        variant=params.variant,
    )
    print(f"chosen: {model}", flush=True)
    sizes = geometries.polygons(
        params.polygon_sizes_m, inputs.sized_leaves, inputs.sized_wood, around
    )
    sizes += geometries.surfels(params.surfel_spacing_m, inputs.surfels, inputs.wood, around)
    sizes += geometries.voxels(params.voxel_sizes_m, inputs.voxels, base, around)
    effects = advise.geometry_effects(one, base, sizes, truth=truth, variant=params.variant)
    facts |= {
        "geometry": refinements.rows(effects),
        "pilot": {
            "sensors": list(table["sensor"].iloc[chosen]),
            "times": [label(stamps[k]) for k in moments],
            "of_sensors": len(table),
            "of_times": len(stamps),
            "variant": params.variant,
            "cores": len(os.sched_getaffinity(0)),
        },
        "notes": advise.notes(sizes, facts, has_truth=truth is not None),
    }
    with atomic(snakemake.output.advice) as partial:
        partial.write_text(HEAD + yaml.safe_dump(refinements.rounded(facts), sort_keys=False))
    json.write(snakemake.output.model, model.as_dict())


if __name__ == "__main__":
    run(main, snakemake)
