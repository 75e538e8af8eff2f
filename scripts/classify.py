"""Tell leaf from wood; score against the truth where it is known."""

import numpy as np

from dapple.cloud import classify
from dapple.cloud.scores import scores
from dapple.formats import clouds, json
from dapple.formats.clouds import Cloud
from dapple.workflow import run


def main(snakemake):
    params, path = snakemake.params, snakemake.input.cloud
    cloud = clouds.read(path)
    facts = {"method": params.method, "points": len(cloud)}
    match params.method:
        case "reflectance":
            facts["threshold_db"] = params.threshold_db
            reflectance = clouds.require(cloud, "Reflectance", path)
            leaf = classify.by_reflectance(reflectance, params.threshold_db)
        case "mixture":
            reflectance = clouds.require(cloud, "Reflectance", path)
            found = classify.find_threshold(reflectance, seed=params.seed)
            facts |= {"threshold_db": found.threshold_db, "ashman_d": found.separation}
            leaf = classify.by_reflectance(reflectance, found.threshold_db)
        case "geometry":
            leaf = classify.by_geometry(cloud.xyz_m)
        case "all_leaf":
            leaf = np.ones(len(cloud), bool)
    leaf = classify.majority(cloud.xyz_m, leaf, params.majority_voxel_m)
    facts["leaf_share"] = float(leaf.mean())
    kinds = classify.codes(leaf)
    if "TrueClass" in cloud.attributes:
        facts["scores"] = scores(kinds, cloud.attributes["TrueClass"])
    classified = Cloud(cloud.xyz_m, cloud.origin_m, cloud.attributes | {"Classification": kinds})
    clouds.write(snakemake.output.cloud, classified)
    json.write(snakemake.output.scores, facts)


if __name__ == "__main__":
    run(main, snakemake)
