"""How far a run can be trusted: its signals, and what they mean."""

from pathlib import Path

from dapple.formats import clouds, json, meshes, netcdf, shots, tables, voxel_grids
from dapple.scene import scene_files, traced
from dapple.stats import pairs
from dapple.structure import polygon_sizes
from dapple.structure.voxel_data import as_estimated
from dapple.verdict import judgement, signals
from dapple.verdict.run_data import RunData, points_per_polygon, with_light
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    found = scanned(inputs, params)
    if inputs.light:
        found = lighted(found, inputs, params)
    judged = judgement.judge(signals.measure(found), tuple(params.reconstructions))
    json.write(snakemake.output.verdict, judged)
    print(
        judged["state"], {name: facts["state"] for name, facts in judged["reconstructions"].items()}
    )


def scanned(inputs, params):
    """Scan, points and reconstructions; what the run did not make stays empty."""
    cloud = clouds.read(inputs.cloud)
    leaves = meshes.read_ply(inputs.leaves[0]) if inputs.leaves else meshes.empty()
    size_m = None
    if params.polygons:
        leaf_m = cloud.xyz_m[cloud.attributes["Classification"] == clouds.LEAF]
        size_m = polygon_sizes.resolved(leaf_m, params.polygons)["voxel_size_m"]
    return RunData(
        shots=shots.read(inputs.shots) if inputs.shots else None,
        cloud=cloud,
        leaves=leaves,
        wood=meshes.read_ply(inputs.wood) if inputs.wood else meshes.empty(),
        points_per_polygon=points_per_polygon(cloud, leaves, size_m) if size_m else None,
        surfels=meshes.read_ply(inputs.surfels[0]) if inputs.surfels else None,
        surfel_facts=json.read(inputs.surfel_facts) if inputs.surfel_facts else {},
        beam=params.beam,
        voxels={
            Path(path).parent.name: as_estimated(voxel_grids.read(path)) for path in inputs.voxels
        },
    )


def lighted(found, inputs, params):
    """The same with light and records."""

    around = scene_files.around(inputs.ground or params.ground_z_m, inputs.shade)

    def scenes_of(name):
        grid = [path for path in inputs.voxels if Path(path).parent.name == name]
        leaves = inputs.surfels if name == "surfels" else grid or inputs.leaves
        scenes = scene_files.read(leaves, inputs.wood, around)
        return (traced.load(scene, params.variant) for scene in scenes)

    return with_light(
        found,
        {Path(path).stem: netcdf.read(path) for path in inputs.light},
        scenes_of,
        sensors_m=tables.read(inputs.sensors)[["x_m", "y_m", "z_m"]].to_numpy(),
        sky=netcdf.read(inputs.sky),
        measured_umol_m2_s=pairs.measured(tables.read(inputs.records)) if inputs.records else None,
        sun_diameter_deg=params.sun_diameter_deg,
        aperture_m=params.aperture_m,
        response=params.response,
        seed=params.seed,
    )


if __name__ == "__main__":
    run(main, snakemake)
