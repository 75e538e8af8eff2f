"""Compare simulated images with renders of single combinations: error, time, memory."""

import resource
import time

import numpy as np
import pandas as pd

from dapple.formats import json, tables
from dapple.frames import direction_from_angles
from dapple.retrieval import coefficient_files as files
from dapple.retrieval import coefficients as collision
from dapple.retrieval import comparison, rendered_images, semiless, spectra
from dapple.scene import scene_files
from dapple.scene.scene_optics import Optics
from dapple.streams import stream_seed
from dapple.workflow import options, run

BANDS = ("450", "560", "650", "730", "840")
STRUCTURES = (1.0, 1.5, 2.0, 2.5)
"""PROSPECT's N for which Semi-LESS is looked at."""
PER_STRUCTURE = 64


def main(snakemake):
    params, inputs = options(snakemake.params), snakemake.input
    scene = scene_files.read_plot(inputs.leaves, inputs.wood, inputs.terrain)
    traced, fitted = files.read(inputs.coefficients), files.read_semiless(inputs.semiless)
    light = params["bark"], np.asarray(params["diffuse_share"])
    drawn, properties = spectra.combinations(
        params["leaves_and_soils"], params["direct_renders"], seed=params["seed"]
    )
    reference, seconds, n_paths = renders(scene, traced, properties, light, params)
    direct_peak_mb = peak_mb()
    found = methods(traced, fitted, properties, light)
    errors = [
        comparison.compare(means, reference, BANDS).assign(method=name, reference="direct")
        for name, means in found.items()
    ]
    errors += structures(traced, fitted, light, params)
    table = pd.concat(errors)[["method", "reference", *errors[0].columns[:-2]]]
    tables.write(snakemake.output.comparison, table)
    tables.write(snakemake.output.renders, per_combination(drawn, properties, reference, found))
    print(table.to_string())
    speeds = speed(traced, fitted, light, params, inputs)
    worst = table[(table.reference == "direct") & (table.scale == "image")].groupby("method")
    each = float(np.mean(seconds))
    n = params["speed_combinations"]
    share = traced.n_paths / n_paths
    speeds += [
        ("direct", n, each * n, direct_peak_mb, len(seconds), n_paths),
        ("direct_same_paths", n, each * n * share, direct_peak_mb, len(seconds), traced.n_paths),
    ]
    names = ["method", "combinations", "seconds", "peak_rss_mb", "measured", "paths_per_pixel"]
    fast = pd.DataFrame(speeds, columns=names)
    fast["rmse_vs_direct"] = fast.method.map(worst.rmse.max())
    fast["max_vs_direct"] = fast.method.map(worst["max"].max())
    tables.write(snakemake.output.speed, fast)
    print(fast.to_string())
    print(
        f"direct: {len(seconds)} renders of {n_paths} paths a pixel took {each:.2f} s each, times "
        f"{n} combinations; direct_same_paths: times {share:.2f}, in proportion to the paths"
    )


def renders(scene, traced, properties, light, params):
    """Means of direct renders of every combination, their times and paths per pixel."""
    sun = direction_from_angles(params["sun"]["zenith_deg"], params["sun"]["azimuth_deg"])
    bark, share = light
    renderer = rendered_images.Renderer(scene, variant=params["variant"])
    parts, seconds = [], []
    for k in range(-1, len(properties)):  # the first is not counted: kernels are compiled
        row = max(k, 0)
        optics = Optics.of_tree(
            np.array(BANDS, float),
            properties.leaf_reflectance[row],
            properties.leaf_transmittance[row],
            np.asarray(bark),
            properties.soil_reflectance[row],
        )
        made = renderer.render(
            traced.window,
            sun,
            optics,
            share,
            n_paths=params["direct_paths"],
            seed=stream_seed(params["seed"], k),
        )
        if k < 0:
            continue
        parts.append(comparison.of_passes(made.passes, traced.window, traced.cell_m))
        seconds.append(made.seconds)
        print(f"render {k}: {made.seconds:.2f} s")
    print(f"scene handed over in {renderer.build_s:.2f} s, which is not counted")
    return comparison.together(parts), seconds, made.n_paths


def methods(traced, fitted, properties, light):
    """Means of the same combinations by both fast methods."""
    leaf, ground = optics_of(properties)
    chunks = semiless.image_chunks(fitted, *leaf, ground)
    return {
        "collision_orders": comparison.of_coefficients(traced, *leaf, light[0], ground, light[1]),
        "semi_less": comparison.of_chunks(chunks, traced.window, traced.cell_m),
    }


def optics_of(properties):
    leaf = properties.leaf_reflectance, properties.leaf_transmittance
    return leaf, properties.soil_reflectance


def structures(traced, fitted, light, params):
    """Semi-LESS against collision orders of the same paths, so without noise, for single N."""
    found = []
    for structure in STRUCTURES:
        seed = stream_seed(params["seed"], "structure")
        _, properties = spectra.combinations(
            params["leaves_and_soils"], PER_STRUCTURE, seed=seed, n=structure
        )
        means = methods(traced, fitted, properties, light)
        exact = means["collision_orders"]
        exact = comparison.Means(exact.cells, np.zeros_like(exact.variance), exact.pixels)
        table = comparison.compare(means["semi_less"], exact, BANDS)
        found.append(table.assign(method=f"semi_less_n_{structure}", reference="collision_orders"))
    return found


def per_combination(drawn, properties, reference, found):
    """One row per combination and band: what went in, and image means of all methods."""
    rows = []
    mean, variance = reference.image
    others = {name: means.image for name, means in found.items()}
    for k in range(len(drawn)):
        for b, band in enumerate(BANDS):
            row = {"combination": k, **drawn.iloc[k], "band": band}
            row["leaf_reflectance"] = properties.leaf_reflectance[k, b]
            row["leaf_transmittance"] = properties.leaf_transmittance[k, b]
            row["soil_reflectance"] = properties.soil_reflectance[k, b]
            row["direct"], row["direct_error"] = mean[k, b], np.sqrt(variance[k, b])
            for name, (values, its_variance) in others.items():
                row[name], row[f"{name}_error"] = values[k, b], np.sqrt(its_variance[k, b])
            rows.append(row)
    return pd.DataFrame(rows)


def speed(traced, fitted, light, params, inputs):
    """Time of images of many combinations by both fast methods, with what they need before."""
    n = params["speed_combinations"]
    seed = stream_seed(params["seed"], "speed")
    _, properties = spectra.combinations(params["leaves_and_soils"], n, seed=seed)
    leaf, ground = optics_of(properties)
    tracing, fitting = json.read(inputs.tracing), json.read(inputs.fitting)
    bark, share = light
    rows = []
    for name, chunks, before, memory in (
        (
            "collision_orders",
            collision.image_chunks(traced, *leaf, bark, ground, share),
            tracing["seconds"],
            tracing["peak_rss_mb"],
        ),
        (
            "semi_less",
            semiless.image_chunks(fitted, *leaf, ground),
            tracing["seconds"] + fitting["seconds"],
            max(tracing["peak_rss_mb"], fitting["peak_rss_mb"]),
        ),
    ):
        started = time.perf_counter()
        for _ in chunks:
            pass
        seconds = time.perf_counter() - started
        print(f"{name}: {before:.1f} s before, {seconds:.1f} s for {n} combinations")
        rows.append((name, n, before + seconds, memory, n, traced.n_paths))
    return rows


def peak_mb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    run(main, snakemake)
