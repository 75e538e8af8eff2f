"""
Stability: where methods fail.

Needs   the configuration; for stability/records.csv light/, structure/, sky/ and statistics/records.csv
Makes   stability/base/{world}/           a world, its undisturbed scan and run, shared by batches
        stability/batches/                one table a stressor and world: all its levels
        stability/points.csv              all runs: agreement with the truth, signals, verdict
        stability/thresholds.csv          from which level on a method has failed
        stability/published.csv           where the published findings hold in these worlds
        stability/map.png, curves.png     by stressor, level and method
        stability/records.csv             a run's own records made worse; not part of a plain run
"""


rule stability_base:
    input:
        code=code("stability_base"),
    output:
        leaves=results("stability/base/{world}/leaves.ply"),
        wood=results("stability/base/{world}/wood.ply"),
        shots=results("stability/base/{world}/shots.parquet"),
        cloud=results("stability/base/{world}/cloud.laz"),
        seconds=results("stability/base/{world}/seconds.json"),
        undisturbed=results("stability/base/{world}/undisturbed.csv"),
    log:
        logs("stability_base_{world}"),
    benchmark:
        benchmarks("stability_base_{world}")
    wildcard_constraints:
        world="[0-9]+",
    conda:
        "../envs/cloud.yaml"
    threads: 1
    resources:
        mem_mb=3000,
    params:
        setup=stability_setup(),
        methods=STABILITY.reconstructions,
        seed=stability_seed,
    message:
        "{settings.experiment}: world {wildcards.world}, undisturbed"
    script:
        "../scripts/stability_base.py"


rule stability_batch:
    input:
        unpack(stability_base),
        code=code("stability_batch"),
    output:
        batch=results("stability/batches/{stressor}_{world}.csv"),
    log:
        logs("stability_{stressor}_{world}"),
    benchmark:
        benchmarks("stability_{stressor}_{world}")
    wildcard_constraints:
        stressor="[a-z_]+",
        world="[0-9]+",
    conda:
        "../envs/cloud.yaml"
    threads: 1
    resources:
        mem_mb=stability_memory,
    params:
        setup=stability_setup(),
        methods=STABILITY.reconstructions,
        levels=STABILITY.levels,
        seed=stability_seed,
    message:
        "{settings.experiment}: {wildcards.stressor}, world {wildcards.world}"
    script:
        "../scripts/stability_batch.py"


rule stability_points:
    input:
        batches=stability_batches(),
        model=stability_model(),
        code=code("stability_points"),
    output:
        points=results("stability/points.csv"),
        thresholds=results("stability/thresholds.csv"),
        published=results("stability/published.csv"),
    log:
        logs("stability_points"),
    benchmark:
        benchmarks("stability_points")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=500,
    message:
        "{settings.experiment}: all runs in one table"
    script:
        "../scripts/stability_points.py"


rule stability_figures:
    input:
        points=results("stability/points.csv"),
        code=code("stability_figures"),
    output:
        map=report(
            results("stability/map.png"),
            caption="../docs/captions/stability.rst",
            category="Stability",
        ),
        curves=results("stability/curves.png"),
    log:
        logs("stability_figures"),
    benchmark:
        benchmarks("stability_figures")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    message:
        "{settings.experiment}: map and curves"
    script:
        "../scripts/stability_figures.py"


if WORSENED:

    rule stability_records:
        input:
            records=results("statistics/records.csv"),
            light=[results(f"light/{name}.nc") for name in WORSENED],
            leaves=leaf_meshes("polygons") if "polygons" in WORSENED else [],
            wood=results("structure/polygons/wood.ply"),
            voxels=[
                results(f"structure/{name}/voxels.nc")
                for name in WORSENED
                if name.startswith("voxels_")
            ],
            sky=results("sky/sky.nc"),
            sensors=results("sky/sensors.csv"),
            code=code("stability_records"),
        output:
            records=results("stability/records.csv"),
        log:
            logs("stability_records"),
        benchmark:
            benchmarks("stability_records")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=4000,
        params:
            methods=WORSENED,
            levels=STABILITY.levels,
            seeds=STABILITY.seeds,
            ground_z_m=settings.ground_z_m,
            variant=f"{VARIANT}_mono",
            sun_diameter_deg=settings.light.sun_diameter_deg,
            aperture_m=settings.light.aperture_m,
            seed=stream("stability_records"),
        message:
            "{settings.experiment}: its own records made worse"
        script:
            "../scripts/stability_records.py"
