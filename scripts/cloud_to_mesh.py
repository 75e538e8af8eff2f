"""Judge the polygons by the distance of the cleaned points from them."""

import numpy as np

from dapple.cloud import cloudcompare
from dapple.formats import clouds, json, meshes
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    cloud = clouds.read(snakemake.input.cloud)
    rng = np.random.default_rng(params.seed)
    n = min(params.max_points, len(cloud))
    chosen = np.sort(rng.choice(len(cloud), n, replace=False))
    mesh = meshes.concatenate(
        [meshes.read_ply(snakemake.input.leaves), meshes.read_ply(snakemake.input.wood)]
    )
    distance_m = cloudcompare.cloud_to_mesh_distance(
        cloud.xyz_m[chosen], mesh, program=params.cloudcompare
    )
    json.write(snakemake.output.distance, cloudcompare.summary(distance_m))


if __name__ == "__main__":
    run(main, snakemake)
