"""
Scan: where points and shots come from.

Needs   nothing (source: virtual), wood polygons (source: wood) or a point cloud (source: cloud)
Makes   config.yaml                       the merged configuration
        structure/truth/*.ply             virtual: the tree itself, leaf and wood area known
        structure/polygons/*.ply          wood: real wood, virtual leaves along it
        scan/points.laz                   points with reflectance and deviation, where known
        scan/frame.json, scan/ground.nc   cloud: origin and coordinate system; heights of the ground
        tree/                             cloud, tree named: its points, stems, neighbours as shade
        scan/shots.parquet                every shot with its returns, misses included
"""


rule configuration:
    input:
        code=code("configuration"),
    output:
        results("config.yaml"),
    log:
        logs("configuration"),
    benchmark:
        benchmarks("configuration")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(200),
    params:
        settings=settings.model_dump(mode="json"),
    message:
        said("the merged configuration")
    script:
        "../scripts/configuration.py"


if settings.source == "virtual":

    rule plant:
        input:
            code=code("plant"),
        output:
            leaves=results("structure/truth/leaves_0.ply"),
            wood=results("structure/truth/wood.ply"),
            summary=results("structure/truth/summary.json"),
        log:
            logs("plant"),
        benchmark:
            benchmarks("plant")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(2000),
        params:
            **dict(settings.plant),
            seed=stream("plant"),
        message:
            said("grow a virtual apple tree")
        script:
            "../scripts/plant.py"


if settings.source == "wood":

    rule real_wood:
        input:
            obj=data(settings.wood_path),
            code=code("real_wood"),
        output:
            wood=results("structure/polygons/wood.ply"),
        log:
            logs("real_wood"),
        benchmark:
            benchmarks("real_wood")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(500),
        message:
            said("wood polygons of {input.obj}")
        script:
            "../scripts/real_wood.py"

    if REAL_LEAVES:

        rule real_leaves:
            input:
                obj=data(settings.leaves.path),
                code=code("real_wood"),
            output:
                leaves=results("structure/polygons/leaves_0.ply"),
            log:
                logs("real_leaves"),
            benchmark:
                benchmarks("real_leaves")
            conda:
                "../envs/dapple.yaml"
            threads: 1
            resources:
                mem_mb=memory(4000),
            message:
                said("leaf polygons of {input.obj}")
            script:
                "../scripts/real_wood.py"

    else:

        rule virtual_leaves:
            input:
                wood=results("structure/polygons/wood.ply"),
                code=code("virtual_leaves"),
            output:
                leaves=results("structure/polygons/leaves_{placement}.ply"),
            log:
                logs("virtual_leaves_{placement}"),
            benchmark:
                benchmarks("virtual_leaves_{placement}")
            conda:
                "../envs/dapple.yaml"
            threads: 1
            resources:
                mem_mb=memory(2000),
            params:
                **settings.leaves.model_dump(exclude={"placements", "path"}),
                seed=lambda wildcards: stream("virtual_leaves", wildcards.placement),
            message:
                said("leaves along the real wood, placement {wildcards.placement}")
            script:
                "../scripts/virtual_leaves.py"

    rule virtual_leaves_summary:
        input:
            leaves=leaf_meshes("polygons"),
            wood=results("structure/polygons/wood.ply"),
            code=code("virtual_leaves_summary"),
        output:
            summary=results("structure/polygons/summary.json"),
        log:
            logs("virtual_leaves_summary"),
        benchmark:
            benchmarks("virtual_leaves_summary")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(1000),
        message:
            said("areas of the real wood and its virtual leaves")
        script:
            "../scripts/virtual_leaves_summary.py"


if settings.source == "cloud":

    rule ingest:
        input:
            cloud=data(settings.cloud.path),
            positions=(
                data(settings.cloud.scan_positions)
                if settings.cloud.scan_positions
                else []
            ),
            code=code("ingest", unused=("check.inspection", "config.settings")),
        output:
            points=results("scan/points.laz"),
            frame=results("scan/frame.json"),
            shots=results("scan/shots.parquet") if settings.has_shots else [],
        log:
            logs("ingest"),
        benchmark:
            benchmarks("ingest")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(4000),
        params:
            unit=settings.cloud.unit,
            up=settings.cloud.up,
            shots=settings.cloud.shots if settings.has_shots else "none",
            scan_frame=settings.scan_frame.model_dump(),
            required=list(CLASSIFIERS[settings.classify.method].needs),
        message:
            said("read {input.cloud}")
        script:
            "../scripts/ingest.py"

    rule find_ground:
        input:
            points=results("scan/points.laz"),
            frame=results("scan/frame.json"),
            code=code("find_ground"),
        output:
            ground=results("scan/ground.nc"),
        log:
            logs("find_ground"),
        benchmark:
            benchmarks("find_ground")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(4000),
        params:
            ground_z_m=settings.ground_z_m,
        message:
            said("the ground under the cloud")
        script:
            "../scripts/find_ground.py"

    if ONE_OF_MANY:

        rule one_tree:
            input:
                points=results("scan/points.laz"),
                ground=results("scan/ground.nc"),
                code=code("one_tree"),
            output:
                points=results("tree/points.laz"),
                neighbours=results("tree/neighbours.ply"),
                stems=results("tree/stems.csv"),
                tree=results("tree/tree.json"),
            log:
                logs("one_tree"),
            benchmark:
                benchmarks("one_tree")
            conda:
                "../envs/dapple.yaml"
            threads: 2
            resources:
                mem_mb=memory(4000),
            params:
                **dict(settings.tree),
                buffer_m=settings.polygons.buffer_m,
                mitre_limit=settings.polygons.mitre_limit,
                seed=stream("neighbours"),
            message:
                said("one tree out of the plot")
            script:
                "../scripts/one_tree.py"

else:
    SCANNED = "truth" if settings.source == "virtual" else "polygons"

    rule scan:
        input:
            leaves=results(f"structure/{SCANNED}/leaves_0.ply"),
            wood=results(f"structure/{SCANNED}/wood.ply"),
            runner=(
                beside_code("virtual/less_scanner_run.py")
                if settings.scan.program == "less"
                else []
            ),
            code=code("scan"),
        output:
            points=results("scan/points.laz"),
            shots=results("scan/shots.parquet"),
        log:
            logs("scan"),
        benchmark:
            benchmarks("scan")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            **dict(settings.scan),
            seed=stream("scan"),
            ground_z_m=GROUND_Z_M,
        message:
            said("scan the tree from {params.positions} positions")
        script:
            "../scripts/scan.py"
