"""
Cloud: from raw points to points that are leaf or wood.

Needs   scan/points.laz
Makes   clean/cloud.laz, clean/clean.json        without noise, one point a voxel; counts of every stage
        classes/cloud.laz, classes/scores.json   with `Classification` (4 leaf, 0 wood); scores, if truth is known
        classes/leaf_wood_model.npz              on demand: the learned classifier, taught by virtual scans
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
        model=LEAF_WOOD_MODEL,
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
        **settings.classify.model_dump(exclude={"training_trees", "model"}),
        seed=stream("classify"),
    message:
        said("leaf or wood by {params.method}")
    script:
        "../scripts/classify.py"


rule leaf_wood_model:
    input:
        code=code("leaf_wood_model"),
    output:
        model=results("classes/leaf_wood_model.npz"),
    log:
        logs("leaf_wood_model"),
    benchmark:
        benchmarks("leaf_wood_model")
    conda:
        "../envs/stability.yaml"
    threads: 2
    resources:
        mem_mb=4000,
    params:
        trees=settings.classify.training_trees,
        seed=stream("leaf_wood_model"),
    message:
        said("what leaf and wood look like, from {params.trees} virtual scans")
    script:
        "../scripts/leaf_wood_model.py"
