"""
Cloud: from raw points to points that are leaf or wood.

Needs   scan/points.laz
Makes   clean/cloud.laz, clean/clean.json        without noise, one point a voxel; counts of every stage
        classes/cloud.laz, classes/scores.json   with `Classification` (4 leaf, 0 wood); scores, if truth is known
"""


rule clean:
    input:
        points=results("tree/points.laz" if ONE_OF_MANY else "scan/points.laz"),
        ground=GROUND,
        code=code("clean"),
    output:
        cloud=results("clean/cloud.laz"),
        counts=results("clean/clean.json"),
    log:
        logs("clean"),
    benchmark:
        benchmarks("clean")
    conda:
        "../envs/cloud.yaml"
    threads: 2
    resources:
        mem_mb=memory(4000),
    params:
        **settings.clean.model_dump(exclude={"distance_points"}),
        ground_z_m=GROUND_Z_M,
        pdal=settings.tools.pdal,
        cloudcompare=settings.tools.cloudcompare,
    message:
        said("noise filter, outliers by {params.outlier_backend}")
    script:
        "../scripts/clean.py"


rule classify:
    input:
        cloud=results("clean/cloud.laz"),
        code=code("classify"),
    output:
        cloud=results("classes/cloud.laz"),
        scores=results("classes/scores.json"),
    log:
        logs("classify"),
    benchmark:
        benchmarks("classify")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(4000),
    params:
        **dict(settings.classify),
        seed=stream("classify"),
    message:
        said("leaf or wood by {params.method}")
    script:
        "../scripts/classify.py"
