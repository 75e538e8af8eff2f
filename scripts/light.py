"""PAR through the day: direct beam traced now, sky and scattered light from counted paths."""

from dapple.formats import json, netcdf, tables
from dapple.light import light_model, series, transport_files
from dapple.scene import scene_files, scene_optics, traced
from dapple.streams import stream_seed
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    sky, optics = netcdf.read(inputs.sky), scene_optics.read(inputs.optics)
    table = tables.read(inputs.sensors)
    advised = json.read(inputs.model) if inputs.model else {"bands": len(optics)}
    model = light_model.Model(**advised)
    sky, optics = light_model.simplified(sky, optics, model)
    placements = []
    for number, (leaves, counted) in enumerate(zip(inputs.leaves, inputs.transports, strict=True)):
        scene = scene_files.read([leaves], inputs.wood, params.ground_z_m)[0]
        paths = transport_files.read(counted)
        sunlit = light_model.sunlit(
            traced.load(scene, params.variant),
            table[["x_m", "y_m", "z_m"]].to_numpy(),
            sky,
            model,
            tolerance=series.DIRECT_SHARE * params.tolerance,
            max_rays=params.max_shadow_rays,
            sun_diameter_deg=params.sun_diameter_deg,
            aperture_m=params.aperture_m,
            seed=stream_seed(params.seed, number),
        )
        placements.append(
            series.compute(sunlit, paths, sky, optics, sun_kernel_deg=params.sun_kernel_deg)
        )
    netcdf.write(snakemake.output.light, series.summarise(placements, list(table["sensor"]), sky))


if __name__ == "__main__":
    run(main, snakemake)
