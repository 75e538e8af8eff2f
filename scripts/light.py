"""PAR through the day: direct beam traced now, sky and scattered light from counted paths."""

from dapple import steps
from dapple.formats import georeference, json, netcdf, tables
from dapple.light import (
    by_sensor,
    light_datasets,
    placed_light,
    series,
    sun_files,
    tiles,
    transport_files,
)
from dapple.light.light_model import Model, Tracing
from dapple.scene import scene_files, scene_optics, sensors, traced
from dapple.scene.facing import facing_of
from dapple.sky.open_sky import towards_sun
from dapple.streams import stream_seed
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)
    sky, optics = netcdf.read(inputs.sky), scene_optics.read(inputs.optics)
    table = tables.read(inputs.sensors)
    model = Model(**(json.read(inputs.model) if inputs.model else {"bands": len(optics)}))
    tracing, tiling = Tracing(**params.tracing), tiles.Tiling(**params.tiles)

    def trace(some):
        placements = []
        for number, leaves in enumerate(inputs.leaves):
            scene = scene_files.read([leaves], inputs.wood, around)[0]
            seed = stream_seed(params.seed, number)

            def see(part, few, seed=seed):
                where, loaded = few[sensors.POSITION].to_numpy(), traced.load(part, params.variant)
                own = {"facing": facing_of(few), "keys": by_sensor.keys(few), "seed": seed}
                seen = steps.sun(loaded, where, sky, model, tracing, **own)
                return sun_files.Suns.from_placements([seen])

            placements += tiles.by_tile(scene, some, tiling, seed, see).placements
        return sun_files.Suns.from_placements(placements)

    files = [*inputs.leaves, inputs.wood, *inputs.code]
    files += [path for path in (inputs.ground, inputs.shade) if path]
    identities = by_sensor.identities(
        table, files, model.sun, model.step_min, tracing, params.ground_z_m,
        params.variant, params.seed, tiling, netcdf.times(sky).asi8, towards_sun(sky),
    )  # fmt: skip
    known = by_sensor.former(snakemake.output.sun, sun_files.read)
    suns = by_sensor.completed(identities, known, table, trace)
    placements = [
        steps.products(
            sunlit, transport_files.read(path)[1], sky, optics, model, tracing, facing_of(table)
        )
        for sunlit, path in zip(suns.placements, inputs.transports, strict=True)
    ]
    light = light_datasets.as_dataset(series.mean(placements), table["sensor"], netcdf.times(sky))
    frame = georeference.read(inputs.cloud, inputs.registration, **params.world)
    mean = float(light["par_umol_m2_s"].mean())
    print(f"{len(table)} sensors, {light.sizes['time']} times, mean PAR {mean:.0f} µmol m⁻² s⁻¹")
    sun_files.write(snakemake.output.sun, suns, identities)
    netcdf.write(snakemake.output.light, placed_light.at_sensors(light, table, frame))


if __name__ == "__main__":
    run(main, snakemake)
