"""Reconstruct one planar polygon per voxel, separately for leaf and wood."""

from dapple import steps
from dapple.formats import clouds, json, meshes, voxel_grids
from dapple.structure import occlusion, summary
from dapple.structure.voxel_data import as_estimated
from dapple.workflow import options, run


def main(snakemake):
    settings = options(snakemake.params)
    correction = settings.pop("correction")
    cloud = clouds.read(snakemake.input.cloud)
    made = steps.polygons(cloud, **settings)
    leaves = made["leaf"]
    if correction:
        grid = as_estimated(voxel_grids.read(snakemake.input.voxels))
        leaves = occlusion.correct(leaves, grid, seed=settings["seed"], **correction)
    meshes.write_ply(snakemake.output.leaves, leaves, cloud.origin_m)
    meshes.write_ply(snakemake.output.wood, made["wood"], cloud.origin_m)
    truth = json.read(snakemake.input.truth) if snakemake.input.truth else None
    facts = summary.of_meshes(leaves, made["wood"], truth)
    facts["n_added"] = leaves.n_elements - made["leaf"].n_elements
    json.write(snakemake.output.summary, facts)


if __name__ == "__main__":
    run(main, snakemake)
