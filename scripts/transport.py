"""Trace paths from the sensors once, for any sky, spectrum and time."""

from dapple.formats import json, tables
from dapple.light import series, transport
from dapple.light import transport_files as files
from dapple.scene import scene_files, scene_optics, traced
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    scene = scene_files.read([inputs.leaves], inputs.wood, params.ground_z_m)[0]
    table = tables.read(inputs.sensors)
    advised = json.read(inputs.model) if inputs.model else {}
    print(f"variant {params.variant}, {len(table)} sensors")
    counted = transport.collect(
        traced.load(scene, params.variant),
        table[["x_m", "y_m", "z_m"]].to_numpy(),
        n_sky_rays=params.sky_rays,
        n_paths=params.paths,
        max_growth=params.max_growth,
        n_patches=advised.get("sky_patches", params.sky_patches),
        max_orders=advised.get("max_orders", params.max_orders),
        tolerance=series.PATH_SHARE * params.tolerance,
        # Nominal spectra: the run's own may change without tracing again.
        optics=scene_optics.from_spectra(),
        sun_kernel_deg=params.sun_kernel_deg,
        aperture_m=params.aperture_m,
        seed=params.seed,
    )
    started = counted.n_paths * counted.n_replicates
    print(f"{started.min()} to {started.max()} paths a sensor, {counted.cut.sum()} given up")
    files.write(snakemake.output.transport, counted)


if __name__ == "__main__":
    run(main, snakemake)
