"""Compare simulated images with renders of single combinations: error, time, memory."""

import numpy as np

from dapple.formats import json, tables
from dapple.frames import direction_from_angles
from dapple.optics.cameras import camera
from dapple.retrieval import coefficient_files as files
from dapple.retrieval import image_methods, spectra
from dapple.retrieval.rendered_images import Renderer
from dapple.scene import scene_files
from dapple.streams import stream_seed
from dapple.workflow import peak_rss_mb, run


def main(snakemake):
    params, inputs, output = snakemake.params, snakemake.input, snakemake.output
    scene = scene_files.read_plot(inputs.leaves, inputs.wood, inputs.terrain)
    traced, fitted = files.read(inputs.coefficients), files.read_semiless(inputs.semiless)
    share, sun = np.asarray(json.read(inputs.sky)["diffuse_share"]), json.read(inputs.sun)
    seen_by = camera(params.bands, *inputs.responses)
    drawn, properties = spectra.combinations(
        params.leaves_and_soils, params.direct_renders, seen_by, seed=params.seed
    )
    reference, render_s, render_paths = image_methods.render_all(
        Renderer(scene, variant=params.variant),
        traced,
        properties,
        towards_sun=direction_from_angles(sun["sun_zenith_deg"], sun["sun_azimuth_deg"]),
        bark=params.bark,
        diffuse_share=share,
        n_paths=params.direct_paths,
        seed=params.seed,
    )
    render_peak_mb = peak_rss_mb()
    images = image_methods.FastImages(traced, fitted, params.bark, share)
    means = images.means(properties)
    table = image_methods.errors(
        images, means, reference, params.leaves_and_soils, seen_by, params.seed
    )
    tables.write(output.comparison, table)
    tables.write(
        output.renders, image_methods.per_combination(drawn, properties, seen_by, reference, means)
    )
    print(table.to_string())
    _, many = spectra.combinations(
        params.leaves_and_soils,
        params.speed_combinations,
        seen_by,
        seed=stream_seed(params.seed, "speed"),
    )
    speeds = image_methods.speed(
        images,
        many,
        tracing=json.read(inputs.tracing),
        fitting=json.read(inputs.fitting),
        render_s=render_s,
        render_paths=render_paths,
        render_peak_mb=render_peak_mb,
        table=table,
    )
    tables.write(output.speed, speeds)
    print(speeds.to_string())


if __name__ == "__main__":
    run(main, snakemake)
