"""Grow a stand and write what each of its voxels truly holds."""

from dapple.survey import grid_files
from dapple.virtual import stands
from dapple.workflow import options, run


def main(snakemake):
    settings = options(snakemake.params)
    size_m = settings.pop("voxel_size_m")
    stand = stands.grow(snakemake.wildcards.stand, **settings)
    areas = {
        f"{name}_area_m2": stands.area_in_voxels(stand, part, size_m)
        for name, part in (("leaf", "leaves"), ("wood", "wood"))
    }
    print(
        f"leaf area index {areas['leaf_area_m2'].sum() / (stand.size_m[0] * stand.size_m[1]):.4f}"
    )
    grid_files.write(snakemake.output.truth, areas, voxel_size_m=size_m)


if __name__ == "__main__":
    run(main, snakemake)
