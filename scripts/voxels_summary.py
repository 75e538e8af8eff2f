"""Areas in voxels with their intervals, and of the wood that stands in them."""

from dapple.formats import json, meshes, netcdf, tables, voxel_grids
from dapple.structure import plant_area
from dapple.structure.summary import of_voxels
from dapple.structure.voxel_data import as_estimated
from dapple.workflow import options, run


def main(snakemake):
    inputs, outputs = snakemake.input, snakemake.output
    wood = meshes.read_ply(inputs.wood) if inputs.wood else None
    truth = json.read(inputs.truth) if inputs.truth else None
    voxels = voxel_grids.read(inputs.voxels)
    found = plant_area.of_voxels(as_estimated(voxels), **options(snakemake.params))
    parts = plant_area.by_part(found)
    netcdf.write(outputs.intervals, plant_area.as_dataset(found, voxels))
    tables.write(outputs.plant_area, parts, "%.6g")
    crown = parts.iloc[0]
    interval = {"plant_area_low_m2": crown["low_m2"], "plant_area_high_m2": crown["high_m2"]}
    json.write(outputs.summary, of_voxels(voxels, wood, truth) | interval)


if __name__ == "__main__":
    run(main, snakemake)
