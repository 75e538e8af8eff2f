"""
Crowns: from an airborne cloud to a scene of facets.

Needs   plots/{plot}/world/lidar.laz, or the user's LAZ
Makes   plots/{plot}/scene/dem.tif         elevation of the ground
        plots/{plot}/scene/chm.tif         height of the canopy
        plots/{plot}/scene/ground.laz      points of the ground
        plots/{plot}/scene/crowns.tif      crowns and sub-crowns by number
        plots/{plot}/scene/summary.json    totals, and how pulses and their light were found
        plots/{plot}/scene/subcrowns.csv   volume and plant area of every sub-crown and layer
        plots/{plot}/scene/leaves.ply, wood.ply   square facets
        plots/{plot}/scene/terrain.ply     the ground as triangles
        plots/{plot}/scene/crowns.png      what was found, to look at
"""


rule plot_ground:
    input:
        lidar=plot_lidar,
        code=code("plot_ground"),
    output:
        dem=plot_file("scene/dem.tif"),
        chm=plot_file("scene/chm.tif"),
        ground=plot_file("scene/ground.laz"),
        facts=plot_file("scene/ground.json"),
    log:
        logs("plot_ground_{plot}"),
    benchmark:
        benchmarks("plot_ground_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(4000),
    params:
        crs=CROWNS.crs,
        noise=CROWN_NOISE,
        ground={
            "pixel_m": CROWNS.dem_pixel_m,
            "cell_m": CROWNS.ground_cell_m,
            "cloth_m": CROWNS.cloth_m,
            "rigidness": CROWNS.ground_rigidness,
            "threshold_m": CROWNS.ground_threshold_m,
        },
        chm_pixel_m=CROWNS.chm_pixel_m,
        reach_m=CROWNS.chm_reach_m,
    message:
        said("ground and canopy height of {wildcards.plot}")
    script:
        "../../scripts/plot_ground.py"


rule plot_crowns:
    input:
        chm=plot_file("scene/chm.tif"),
        facts=plot_file("scene/ground.json"),
        code=code("plot_crowns"),
    output:
        crowns=plot_file("scene/crowns.tif"),
    log:
        logs("plot_crowns_{plot}"),
    benchmark:
        benchmarks("plot_crowns_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        crowns={
            "min_height_m": CROWNS.min_height_m,
            "smoothing_m": CROWNS.smoothing_m,
            "min_distance_m": CROWNS.min_distance_m,
            "min_area_m2": CROWNS.min_area_m2,
        },
        area_m2=CROWNS.subcrown_area_m2,
        least_points=CROWNS.subcrown_points,
        seed=lambda wildcards: stream("sub_crowns", wildcards.plot),
    message:
        said("crowns and sub-crowns of {wildcards.plot}")
    script:
        "../../scripts/plot_crowns.py"


rule plot_scene:
    input:
        lidar=plot_lidar,
        dem=plot_file("scene/dem.tif"),
        chm=plot_file("scene/chm.tif"),
        crowns=plot_file("scene/crowns.tif"),
        code=code("plot_scene"),
    output:
        table=plot_file("scene/subcrowns.csv"),
        leaves=plot_file("scene/leaves.ply"),
        wood=plot_file("scene/wood.ply"),
        terrain=plot_file("scene/terrain.ply"),
        summary=plot_file("scene/summary.json"),
        picture=plot_file("scene/crowns.png"),
        vector=plot_file("scene/crowns.pdf"),
    log:
        logs("plot_scene_{plot}"),
    benchmark:
        benchmarks("plot_scene_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(6000),
    params:
        noise=CROWN_NOISE,
        n_layers=CROWNS.layers,
        base_share=CROWNS.base_share,
        min_height_m=CROWNS.min_leaf_height_m,
        voxel_m=CROWNS.voxel_m,
        alpha_m=CROWNS.alpha_m,
        alpha_spacings=CROWNS.alpha_spacings,
        clumping_index=CROWNS.clumping_index,
        wood_share=CROWNS.wood_share,
        facet_area_m2=CROWNS.facet_area_m2,
        terrain_step_m=CROWNS.terrain_step_m,
        pulse_options={
            "window_s": CROWNS.window_s,
            "range_exponent": CROWNS.range_exponent,
            "ground_to_canopy_intensity": CROWNS.ground_to_canopy_intensity,
            "projection": CROWNS.projection,
            "max_density_m2_m3": CROWNS.max_density_m2_m3,
        },
        seed=lambda wildcards: stream("facets", wildcards.plot),
    message:
        said("fill the crowns of {wildcards.plot} with facets")
    script:
        "../../scripts/plot_scene.py"
