"""Light on the ground around the tree, hour by hour."""

import numpy as np

from dapple.formats import georeference, netcdf, rasters
from dapple.light.par_on_ground import par_on_ground
from dapple.scene import scene_files, scene_optics
from dapple.stats import ground_sums
from dapple.times import hourly, spread
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    sky = netcdf.read(inputs.sky)
    times = netcdf.times(sky)
    chosen = hourly(times, params.timezone)
    is_day = sky["sun_zenith_deg"].to_numpy()[chosen] < 90
    chosen = chosen[is_day] if is_day.any() else chosen
    if params.times:
        chosen = np.union1d(chosen, spread(times, params.times, 0, params.timezone))
    # One placement is what stands there at a time; a mean would blur its flecks.
    scene = scene_files.read(inputs.leaves[:1], inputs.wood, around)[0]
    par = par_on_ground(
        scene,
        around.ground,
        sky.isel(time=chosen),
        scene_optics.read(inputs.optics),
        spacing_m=params.spacing_m,
        margin_m=params.margin_m,
        seed=params.seed,
        **params.tracing,
    )
    frame = georeference.read(inputs.cloud, inputs.registration, **params.world)
    found = georeference.located(ground_sums.with_sum(par, params.timezone), frame)
    netcdf.write(snakemake.output.map, found)
    for output, name in (("hourly", ground_sums.PAR), ("daily", ground_sums.SUM)):
        made = ground_sums.raster(found[name], frame)
        rasters.write(snakemake.output[output], made, cloud_optimized=True)


if __name__ == "__main__":
    run(main, snakemake)
