"""Plant area density from shots, misses included."""

import numpy as np

from dapple.formats import clouds, shots, voxels
from dapple.structure.returns import kinds_by_place
from dapple.structure.voxels import Grid, plant_area_density
from dapple.workflow import options, run


def main(snakemake):
    settings = options(snakemake.params)
    classified = clouds.read(snakemake.input.classes)
    kinds = kinds_by_place(
        classified.xyz_m,
        classified.attributes["Classification"],
        voxel_size_m=settings.pop("majority_voxel_m"),
    )
    bounds_m = np.array([classified.xyz_m.min(axis=0), classified.xyz_m.max(axis=0)])
    grid = Grid.around(bounds_m, float(snakemake.wildcards.size))
    density = plant_area_density(
        shots.iterate(snakemake.input.shots), grid, kinds=kinds, **settings
    )
    voxels.write(snakemake.output.voxels, density)
    voxels.write_vox(snakemake.output.amapvox, density)


if __name__ == "__main__":
    run(main, snakemake)
