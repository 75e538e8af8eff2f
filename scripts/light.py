"""PAR through the day: direct beam traced now, sky and scattered light from counted paths."""

from dapple import steps
from dapple.formats import georeference, json, netcdf, tables
from dapple.light import light_datasets, placed_light, series, transport_files
from dapple.light.light_model import Model, Tracing
from dapple.scene import scene_files, scene_optics, sensors, traced
from dapple.scene.facing import facing_of
from dapple.streams import stream_seed
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    sky, optics = netcdf.read(inputs.sky), scene_optics.read(inputs.optics)
    table = tables.read(inputs.sensors)
    sensors_m, facing = table[sensors.POSITION].to_numpy(), facing_of(table)
    model = Model(**(json.read(inputs.model) if inputs.model else {"bands": len(optics)}))
    tracing = Tracing(**params.tracing)
    placements = []
    for number, (leaves, counted) in enumerate(zip(inputs.leaves, inputs.transports, strict=True)):
        scene = scene_files.read([leaves], inputs.wood, around)[0]
        loaded, seed = traced.load(scene, params.variant), stream_seed(params.seed, number)
        sunlit = steps.sun(loaded, sensors_m, sky, model, tracing, facing=facing, seed=seed)
        paths = transport_files.read(counted)
        placements.append(steps.products(sunlit, paths, sky, optics, model, tracing, facing))
    light = light_datasets.as_dataset(series.mean(placements), table["sensor"], netcdf.times(sky))
    frame = georeference.read(inputs.cloud, inputs.registration, **params.world)
    netcdf.write(snakemake.output.light, placed_light.at_sensors(light, table, frame))


if __name__ == "__main__":
    run(main, snakemake)
