"""Scan a virtual plot from a UAV."""

import time

import numpy as np

from dapple.formats import clouds, json, meshes, tables
from dapple.formats.clouds import Cloud
from dapple.virtual import plots, uav_scanner
from dapple.workflow import options, run


def main(snakemake):
    settings, inputs = options(snakemake.params), snakemake.input
    begun = time.perf_counter()
    trees = tables.read(inputs.trees)
    origin_m = np.asarray(settings["origin_m"], float)
    trees[["x_m", "y_m", "z_m"]] -= origin_m
    world = {
        "leaf": plots.place([meshes.read_ply(path) for path in inputs.leaves], trees)[0],
        "wood": plots.place([meshes.read_ply(path) for path in inputs.wood], trees)[0],
        "ground": meshes.read_ply(inputs.terrain),
    }
    ground = world["ground"].vertices_m
    cloud = together(
        uav_scanner.scan(
            world,
            uav_scanner.Flight(**settings["flight"]),
            low_m=ground[:, :2].min(axis=0),
            high_m=ground[:, :2].max(axis=0),
            ground_z_m=float(ground[:, 2].mean()),
            origin_m=origin_m,
            seed=settings["seed"],
        )
    )
    truth = cloud.attributes.pop("Truth")
    clouds.write(snakemake.output.lidar, cloud, scale_m=0.001, crs=settings["crs"])
    area_m2 = float(np.prod(np.ptp(ground[:, :2], axis=0)))
    first = cloud.attributes["ReturnNumber"] == 1
    facts = {
        "n_points": len(cloud),
        "points_per_m2": len(cloud) / area_m2,
        "returns_per_pulse": len(cloud) / float(first.sum()),
        "flight_lines": len(np.unique(cloud.attributes["PointSourceId"])),
        "leaf_share": float((truth == 4).mean()),
        "wood_share": float((truth == 0).mean()),
        "ground_share": float((truth == 2).mean()),
        "seconds": time.perf_counter() - begun,
    }
    json.write(snakemake.output.summary, facts)
    print(facts)


def together(parts):
    """All chunks as one cloud."""
    parts = list(parts)
    names = parts[0].attributes
    return Cloud(
        np.concatenate([part.xyz_m for part in parts]),
        parts[0].origin_m,
        {name: np.concatenate([part.attributes[name] for part in parts]) for name in names},
    )


if __name__ == "__main__":
    run(main, snakemake)
