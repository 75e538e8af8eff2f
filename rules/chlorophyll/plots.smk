"""
Plots: virtual conifers, UAV LiDAR and UAV images with known chlorophyll.

Needs   nothing; a rule runs only for what the user gives no file of
Makes   plots/{plot}/world/trees.csv       trees in world coordinates, their size and chlorophyll
        plots/{plot}/world/crowns.geojson  outlines of the field trees
        plots/{plot}/world/terrain.ply     the true ground
        plots/{plot}/world/grown_*.ply     leaves and wood of the trees that others are copies of
        plots/{plot}/world/lidar.laz       returns of a UAV's laser scanner
        plots/{plot}/world/images.tif      reflectance as a UAV's camera sees it
"""


rule plot_world:
    input:
        code=code("plot_world"),
    output:
        trees=plot_file("world/trees.csv"),
        crowns=plot_file("world/crowns.geojson"),
        terrain=plot_file("world/terrain.ply"),
        leaves=grown_files("leaves"),
        wood=grown_files("wood"),
        summary=plot_file("world/summary.json"),
    log:
        logs("plot_world_{plot}"),
    benchmark:
        benchmarks("plot_world_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500),
    params:
        species=lambda wildcards: plot_of(wildcards).species,
        sizes=lambda wildcards: plot_of(wildcards).model_dump(include=SIZES),
        tree=plot_tree,
        crown_leaf_area_index=lambda wildcards: plot_of(wildcards).crown_leaf_area_index,
        grown_trees=WORLD.grown_trees,
        planting=plot_planting,
        field_trees=lambda wildcards: plot_of(wildcards).field_trees,
        lcc=WORLD_LCC,
        chemistry=WORLD_CHEMISTRY,
        terrain=WORLD.model_dump(include={"slope", "wave_height_m", "wave_length_m"}),
        terrain_step_m=WORLD.terrain_step_m,
        crs=WORLD.crs,
        origin_m=WORLD.origin_m,
        seed=lambda wildcards: stream("plot_world", wildcards.plot),
    message:
        said("grow the {wildcards.plot} plot")
    script:
        "../../scripts/plot_world.py"


rule plot_lidar:
    input:
        trees=plot_file("world/trees.csv"),
        terrain=plot_file("world/terrain.ply"),
        leaves=grown_files("leaves"),
        wood=grown_files("wood"),
        code=code("plot_lidar"),
    output:
        lidar=plot_file("world/lidar.laz"),
        summary=plot_file("world/lidar.json"),
    log:
        logs("plot_lidar_{plot}"),
    benchmark:
        benchmarks("plot_lidar_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(6000),
    params:
        flight=WORLD_FLIGHT,
        crs=WORLD.crs,
        origin_m=WORLD.origin_m,
        seed=lambda wildcards: stream("plot_lidar", wildcards.plot),
    message:
        said("scan the {wildcards.plot} plot from a UAV")
    script:
        "../../scripts/plot_lidar.py"


rule uav_images:
    input:
        trees=plot_file("world/trees.csv"),
        terrain=plot_file("world/terrain.ply"),
        leaves=grown_files("leaves"),
        wood=grown_files("wood"),
        sun=SUN,
        responses=RESPONSES,
        runner=beside_code("virtual/less_camera_run.py"),
        code=code("uav_images"),
    output:
        images=plot_file("world/images.tif"),
        summary=plot_file("world/images.json"),
    log:
        logs("uav_images_{plot}"),
    benchmark:
        benchmarks("uav_images_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(5000),
    params:
        size_m=lambda wildcards: plot_of(wildcards).size_m,
        pixel_m=lambda wildcards: plot_of(wildcards).pixel_m,
        bands=BANDS,
        renderer=WORLD.renderer,
        paths_per_pixel=WORLD.paths_per_pixel,
        noise={"relative": WORLD.relative_noise, "absolute": WORLD.absolute_noise},
        ground=WORLD_GROUND,
        crown=WORLD_CROWN,
        camera=WORLD_CAMERA,
        aerosol_optical_depth=WORLD.aerosol_optical_depth,
        crs=WORLD.crs,
        origin_m=WORLD.origin_m,
        seed=lambda wildcards: stream("plot_images", wildcards.plot),
    message:
        said("photograph the {wildcards.plot} plot")
    script:
        "../../scripts/uav_images.py"
