"""Trace the light of every pixel of a plot's images once, for any leaf and soil."""

import time

from dapple.formats import json, rasters
from dapple.frames import direction_from_angles
from dapple.retrieval import coefficient_files as files
from dapple.retrieval import image_paths, maps
from dapple.retrieval.coefficients import Combinations, Window, projection_error, remainder_bound
from dapple.scene import scene_files, traced
from dapple.workflow import options, peak_rss_mb, run

BRIGHT = Combinations(0.47, 0.47, bark=0.3, soil=0.4, diffuse_share=0.1)
"""Leaf reflectance and transmittance, bark and soil for which errors are told in the facts."""


def main(snakemake):
    params, inputs = options(snakemake.params), snakemake.input
    observed = rasters.read(inputs.images)
    origin_m = json.read(inputs.summary)["world_origin_m"]
    sun = json.read(inputs.sun)
    rows, columns = maps.shape_of(observed, params["pixel_m"])
    window = Window(
        observed.left_m - origin_m[0],
        observed.top_m - origin_m[1],
        params["pixel_m"],
        rows,
        columns,
    )
    n_paths = max(params["paths_per_pixel"], -(-params["least_paths"] // window.n_pixels))
    started = time.perf_counter()
    scene = scene_files.read_plot(inputs.leaves, inputs.wood, inputs.terrain)
    coefficients = image_paths.trace(
        traced.load(scene, params["variant"]),
        window,
        direction_from_angles(sun["sun_zenith_deg"], sun["sun_azimuth_deg"]),
        n_paths=n_paths,
        n_columns=params["columns"],
        max_orders=params["max_orders"],
        cell_m=params["cell_m"],
        seed=params["seed"],
    )
    seconds = time.perf_counter() - started
    files.write(snakemake.output.coefficients, coefficients)
    facts = {
        "rows": rows,
        "columns": columns,
        "paths_per_pixel": coefficients.n_paths,
        "kinds_of_paths": len(coefficients.orders),
        "longest_path": int(coefficients.orders.sum(axis=1, dtype=int).max()),
        "projection_error_bright": projection_error(coefficients, BRIGHT).item(),
        "remainder_bound_bright": remainder_bound(coefficients, BRIGHT).item(),
        "seconds": seconds,
        "paths_per_s": window.n_pixels * coefficients.n_paths / seconds,
        "peak_rss_mb": peak_rss_mb(),
    }
    json.write(snakemake.output.facts, facts)
    print(facts)


if __name__ == "__main__":
    run(main, snakemake)
