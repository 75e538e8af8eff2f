"""Fit the origin of the tree's frame and the clock offset on a part of the records."""

import numpy as np

from dapple.formats import json
from dapple.registration import shading
from dapple.scene import scene_files, sensors
from dapple.sky import measured_sky
from dapple.sky.radiation_series import broadband
from dapple.sky.sky_radiance import sky_dataset
from dapple.sky.sun import Site
from dapple.stats import measured
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    # The cloud's own origin, unless the configuration knows another.
    known = json.read(inputs.frame)["origin_m"] if inputs.frame else params.origin_m or (0.0,) * 3
    site = Site(**params.site)
    skies = [measured_sky.read(path) for path in inputs.sky_table]

    def sky_at(times):
        radiation = broadband(times, site, path=inputs.radiation or None, **params.radiation)
        measured = [sky.at(times) for sky in skies]
        return sky_dataset(times, site, radiation.values, *measured, **params.atmosphere)

    table = sensors.read(inputs.sensors, known, **params.sensors)
    if params.sensors["heights"] == "above_ground":
        ground = scene_files.around(inputs.ground or params.ground_z_m).ground
        table = sensors.on_ground(table, ground)
    found = shading.register(
        scene_files.read(inputs.leaves, inputs.wood),
        table,
        measured.read(inputs.measured, sensors=table, **params.records).table,
        sky_at=sky_at,
        max_shift_m=params.max_shift_m,
        max_clock_offset_s=params.max_clock_offset_s,
        split_by=params.split,
        fit_share=params.fit_share,
        sun_diameter_deg=params.sun_diameter_deg,
        aperture_m=params.aperture_m,
        response=params.response,
        gain=params.gain,
        variant=params.variant,
        seed=params.seed,
    )
    shift_m = np.array([found["east_m"], found["north_m"], 0.0])
    origin_m = np.array(known) + shift_m
    json.write(snakemake.output.registration, {"fitted": True, "origin_m": origin_m, **found})


if __name__ == "__main__":
    run(main, snakemake)
