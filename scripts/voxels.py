"""Plant area density from shots, misses included."""

import numpy as np

from dapple.formats import clouds, shots, voxel_grids
from dapple.structure import subvoxel_clumping
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
    correction = settings.pop("correction")

    def density_in(size_m):
        fired = shots.iterate(snakemake.input.shots)
        return plant_area_density(fired, Grid.around(bounds_m, size_m), kinds=kinds, **settings)

    density = density_in(float(snakemake.wildcards.size))
    if correction:
        finer_m = correction.pop("finer_m")
        density = subvoxel_clumping.correct(
            density,
            density_in(finer_m) if finer_m else None,
            shots.read(snakemake.input.shots),
            kinds=kinds,
            **correction,
        )
    voxel_grids.write(snakemake.output.voxels, density)
    voxel_grids.write_vox(snakemake.output.amapvox, density)


if __name__ == "__main__":
    run(main, snakemake)
