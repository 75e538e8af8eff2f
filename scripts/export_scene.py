"""Write the scene of one reconstruction for LESS 3, ready to run, and as glTF."""

from pathlib import Path

from dapple.formats import gltf, netcdf
from dapple.light import less_files
from dapple.light.less_files import LessRays
from dapple.scene import scene_files, scene_optics
from dapple.workflow import run

RED_GREEN_BLUE_NM = (650.0, 550.0, 450.0)


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    optics = scene_optics.read(inputs.optics)
    scenes, table = scene_files.with_sensors(inputs, params)
    rays = LessRays(**params.rays, seed=params.seed)
    sky, folder = netcdf.read(inputs.sky), Path(snakemake.output.less)
    less_files.write(folder, scenes[0], optics, sky, table, rays, params.aperture_m)
    meshes = {
        f"{one.optics}_{number}": (
            one.mesh,
            one.places_m,
            optics.reflectance_at(one.optics, RED_GREEN_BLUE_NM),
        )
        for number, one in enumerate(scenes[0].filled)
    }
    gltf.write(snakemake.output.gltf, meshes)


if __name__ == "__main__":
    run(main, snakemake)
