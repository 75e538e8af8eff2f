"""Write a scene, its sensors and its light at the highest sun as glTF and scene.json."""

from pathlib import Path

from dapple.formats import netcdf
from dapple.scene import exchange, scene_files, scene_optics
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    scenes, table = scene_files.with_sensors(inputs, params)
    lit = exchange.at_highest_sun(
        scenes[0],
        scene_optics.read(inputs.optics),
        netcdf.read(inputs.sky),
        table,
        params.aperture_m,
    )
    exchange.write(Path(snakemake.output.folder), lit, params.description)


if __name__ == "__main__":
    run(main, snakemake)
