"""
Advice and trade-off: how finely light has to be computed. Not part of a plain run.

Needs   structure/, sky/, classes/cloud.laz, scan/shots.parquet
Makes   advice.yaml                       what each refinement changes and costs on a pilot
        figures/advice.png                the same as a picture
        light/model.json                  the cheapest model within the tolerance, for light.model: advised
        structure/polygons_{size}/        polygons of other voxel sizes
        tradeoff/points.csv               error and cost over a grid of settings
        tradeoff/chart.png, chart.html    accuracy against speed
"""

# What the pilot and the grid have in common with the run itself.
PILOT = {
    **tracing("max_orders"),
    "ground_z_m": GROUND_Z_M,
    "variant": f"{VARIANT}_mono",
}

if settings.source != "wood":

    rule sized_polygons:
        input:
            cloud=results("classes/cloud.laz"),
            truth=[],
            code=code("polygons", unused=["structure.occlusion"]),
        output:
            leaves=results("structure/polygons_{size}/leaves_0.ply"),
            wood=results("structure/polygons_{size}/wood.ply"),
            summary=results("structure/polygons_{size}/summary.json"),
        log:
            logs("sized_polygons_{size}"),
        benchmark:
            benchmarks("sized_polygons_{size}")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(2000),
        params:
            **settings.polygons.model_dump(exclude={"voxel_size_m"}),
            voxel_size_m=lambda wildcards: float(wildcards.size),
            correction=None,
            bracket=False,
            seed=stream("polygons"),
        message:
            said("polygons from {wildcards.size} m voxels")
        script:
            "../scripts/polygons.py"


if LIT:

    rule advice:
        input:
            **sized(settings.advice),
            ground=GROUND,
            shade=SHADE,
            code=code("advice"),
        output:
            advice=results("advice.yaml"),
            model=results("light/model.json"),
        log:
            logs("advice"),
        benchmark:
            benchmarks("advice")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            **settings.advice.model_dump(exclude={"paths"}),
            **PILOT,
            surfel_spacing_m=settings.surfels.spacing_m,
            tracing={"paths": settings.advice.paths, "sky_rays": settings.advice.paths}
            | tracing(
                "tolerance",
                "max_shadow_rays",
                "sun_kernel_deg",
                "sun_diameter_deg",
                "aperture_m",
                "response",
            ),
            seed=stream("advice"),
        message:
            said("what each refinement of the light changes and costs")
        script:
            "../scripts/advice.py"

    rule tradeoff_points:
        input:
            **sized(settings.tradeoff),
            ground=GROUND,
            shade=SHADE,
            runner=beside_code("light/less_run.py") if BY_LESS else [],
            code=code("tradeoff_points"),
        output:
            points=results("tradeoff/points.csv"),
        log:
            logs("tradeoff_points"),
        benchmark:
            benchmarks("tradeoff_points")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            **settings.tradeoff.model_dump(exclude={"max_orders", "less_rays"}),
            **PILOT,
            tracing=tracing(
                "sun_kernel_deg", "sun_diameter_deg", "aperture_m", "response"
            ),
            orders=settings.tradeoff.max_orders,
            polygon_size_m=settings.polygons.nominal_m,
            surfel_spacing_m=settings.surfels.spacing_m,
            timestep=REFERENCE,
            less_rays=settings.tradeoff.less_rays if BY_LESS else [],
            less=LESS_RAYS | {"bands": LESS.bands, "aperture_m": OF_BEAM["aperture_m"]},
            seed=stream("tradeoff"),
        message:
            said("error and cost of a grid of settings")
        script:
            "../scripts/tradeoff_points.py"

    rule tradeoff_page:
        input:
            points=results("tradeoff/points.csv"),
            code=code("tradeoff_page"),
        output:
            page=results("tradeoff/chart.html"),
        log:
            logs("tradeoff_page"),
        benchmark:
            benchmarks("tradeoff_page")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(1000),
        params:
            experiment=settings.experiment,
        message:
            said("accuracy against speed")
        script:
            "../scripts/tradeoff_page.py"

    rule tradeoff:
        input:
            results("tradeoff/points.csv"),
            results("tradeoff/chart.png"),
            results("tradeoff/chart.html"),
        message:
            said("tradeoff/")
