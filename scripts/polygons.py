"""Reconstruct one planar polygon per voxel, separately for leaf and wood."""

from dapple import findings, steps
from dapple.formats import clouds, json, meshes, voxel_grids
from dapple.structure import occlusion, polygon_sizes, summary
from dapple.structure.voxel_data import as_estimated
from dapple.workflow import options, run


def main(snakemake):
    settings = options(snakemake.params)
    correction, is_bracketed = settings.pop("correction"), settings.pop("bracket")
    cloud = clouds.read(snakemake.input.cloud)
    points_m, origin_m = steps.points_by_kind(cloud), cloud.origin_m
    del cloud  # a large one has no room beside its polygons
    made = steps.polygons_of(points_m, **settings)
    leaves = made["leaf"]
    if correction:
        grid = as_estimated(voxel_grids.read(snakemake.input.voxels))
        leaves = occlusion.correct(leaves, grid, seed=settings["seed"], **correction)
    for kind, mesh in (("leaf", leaves), ("wood", made["wood"])):
        print(f"{mesh.n_elements:,} {kind} polygons, {mesh.area_m2:.2f} m²")
    meshes.write_ply(snakemake.output.leaves, leaves, origin_m)
    meshes.write_ply(snakemake.output.wood, made["wood"], origin_m)
    truth = json.read(snakemake.input.truth) if snakemake.input.truth else None
    facts = summary.of_meshes(leaves, made["wood"], truth)
    facts["n_added"] = leaves.n_elements - made["leaf"].n_elements
    del leaves, made
    if is_bracketed:
        leaf_m = points_m["leaf"]
        used = polygon_sizes.resolved(leaf_m, settings)
        areas = polygon_sizes.bracket(leaf_m, **used)
        fit = polygon_sizes.resolved(leaf_m, settings | {"voxel_size_m": polygon_sizes.AUTO})
        findings.say(polygon_sizes.doubts(areas, snakemake.input.cloud, fit["voxel_size_m"]))
        facts |= {
            "voxel_size_m": used["voxel_size_m"],
            "fitting_voxel_size_m": fit["voxel_size_m"],
            "leaf_area_m2_by_voxel_size_m": areas,
        }
    json.write(snakemake.output.summary, facts)


if __name__ == "__main__":
    run(main, snakemake)
