"""Plant area density from shots, misses included."""

from dapple import steps
from dapple.formats import clouds, shots, voxel_grids
from dapple.structure import subvoxel_clumping
from dapple.workflow import options, run


def main(snakemake):
    settings, path = options(snakemake.params), snakemake.input.shots
    cloud = clouds.read(snakemake.input.classes)
    correction = settings.pop("correction")
    settings["kinds"] = steps.return_kinds(cloud, settings.pop("majority_voxel_m"))
    size_m = float(snakemake.wildcards.size)
    fired = shots.Stored(path, "shots through voxels")
    density = steps.voxels(fired, cloud, size_m, **settings)
    if correction:
        finer_m = correction.pop("finer_m")
        density = subvoxel_clumping.correct(
            density,
            steps.voxels(fired, cloud, finer_m, **settings) if finer_m else None,
            shots.read(path),
            kinds=settings["kinds"],
            **correction,
        )
    unknown = float(density["plant_area_density_m2_m3"].isnull().mean())
    print(
        f"{density.attrs['total_shots']:,} shots, {density['flag'].size:,} voxels of {size_m:g} m, "
        f"{unknown:.1%} unknown"
    )
    voxel_grids.write(snakemake.output.voxels, density)
    voxel_grids.write_vox(snakemake.output.amapvox, density)


if __name__ == "__main__":
    run(main, snakemake)
