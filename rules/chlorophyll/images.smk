"""
Images: simulated UAV images of many leaves and soils from one trace.

Needs   plots/{plot}/scene/leaves.ply, wood.ply, terrain.ply, summary.json
        plots/{plot}/world/images.tif, or the user's: its place and size
Makes   plots/{plot}/images/coefficients.nc   what every pixel receives, for any leaf and soil
        plots/{plot}/images/semiless.nc       the terms of Semi-LESS, fitted to the same paths
        plots/{plot}/images/comparison.csv    both against renders of single combinations
        plots/{plot}/images/renders.csv       the same, combination by combination
        plots/{plot}/images/speed.csv         time, memory and error of each method
        chlorophyll/comparison.csv, speed.csv of all plots
"""


rule image_coefficients:
    input:
        leaves=plot_file("scene/leaves.ply"),
        wood=plot_file("scene/wood.ply"),
        terrain=plot_file("scene/terrain.ply"),
        summary=plot_file("scene/summary.json"),
        images=plot_images,
        sun=SUN,
        code=code("image_coefficients"),
    output:
        coefficients=plot_file("images/coefficients.nc"),
        facts=plot_file("images/tracing.json"),
    log:
        logs("image_coefficients_{plot}"),
    benchmark:
        benchmarks("image_coefficients_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(3000),
    params:
        pixel_m=IMAGES.pixel_m,
        paths_per_pixel=IMAGES.paths_per_pixel,
        least_paths=IMAGES.least_paths,
        columns=IMAGES.columns,
        max_orders=IMAGES.max_orders,
        cell_m=RETRIEVAL.map_pixel_m,
        variant=f"{VARIANT}_rgb",
        seed=lambda wildcards: stream("image_coefficients", wildcards.plot),
    message:
        said("trace the light of the pixels of {wildcards.plot}")
    script:
        "../../scripts/image_coefficients.py"


rule image_semiless:
    input:
        coefficients=plot_file("images/coefficients.nc"),
        sky=SKYLIGHT,
        code=code("image_semiless"),
    output:
        semiless=plot_file("images/semiless.nc"),
        facts=plot_file("images/fitting.json"),
    log:
        logs("image_semiless_{plot}"),
    benchmark:
        benchmarks("image_semiless_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        levels=IMAGES.absorption_levels,
        structure=IMAGES.leaf_structure,
        degree=IMAGES.degree,
        bark=BARK,
        soils=IMAGES.reference_soils,
    message:
        said("fit Semi-LESS to the images of {wildcards.plot}")
    script:
        "../../scripts/image_semiless.py"


rule image_comparison:
    input:
        leaves=plot_file("scene/leaves.ply"),
        wood=plot_file("scene/wood.ply"),
        terrain=plot_file("scene/terrain.ply"),
        coefficients=plot_file("images/coefficients.nc"),
        semiless=plot_file("images/semiless.nc"),
        tracing=plot_file("images/tracing.json"),
        fitting=plot_file("images/fitting.json"),
        sun=SUN,
        sky=SKYLIGHT,
        responses=RESPONSES,
        code=code("image_comparison"),
    output:
        comparison=plot_file("images/comparison.csv"),
        renders=plot_file("images/renders.csv"),
        speed=plot_file("images/speed.csv"),
    log:
        logs("image_comparison_{plot}"),
    benchmark:
        benchmarks("image_comparison_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(3000),
    params:
        bands=BANDS,
        leaves_and_soils=LEAVES_AND_SOILS,
        bark=BARK,
        direct_renders=IMAGES.direct_renders,
        direct_paths=IMAGES.direct_paths,
        speed_combinations=IMAGES.speed_combinations,
        variant=f"{VARIANT}_rgb",
        seed=lambda wildcards: stream("image_comparison", wildcards.plot),
    message:
        said("render {wildcards.plot} directly, to compare")
    script:
        "../../scripts/image_comparison.py"


rule image_speed:
    input:
        speed=[results(f"plots/{plot}/images/speed.csv") for plot in CHLOROPHYLL.plots],
        comparison=[
            results(f"plots/{plot}/images/comparison.csv")
            for plot in CHLOROPHYLL.plots
        ],
        code=code("image_speed"),
    output:
        speed=results("chlorophyll/speed.csv"),
        comparison=results("chlorophyll/comparison.csv"),
    log:
        logs("image_speed"),
    benchmark:
        benchmarks("image_speed")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    params:
        plots=CHLOROPHYLL.plots,
    message:
        said("time and error of simulated images")
    script:
        "../../scripts/image_speed.py"
