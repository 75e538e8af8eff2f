"""
Map: where reconstructions fail, and which signals give it away.

Needs   stability/batches/
Makes   stability/points.csv              all runs: agreement with the truth, signals, verdict
        stability/thresholds.csv          from which level on a reconstruction has failed
        stability/published.csv           where the published findings hold in these worlds
        stability/map.png, curves.png     by stressor, level and reconstruction
        stability/verdict_model.json, verdict.csv   fitted to these runs; detection and false alarms
"""


rule stability_points:
    input:
        batches=stability_batches(),
        model=beside_code("verdict/verdict_model.json"),
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
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    message:
        said("all runs in one table")
    script:
        "../../scripts/stability_points.py"


rule stability_figures:
    input:
        points=results("stability/points.csv"),
        code=code("stability_figures"),
    output:
        map=report(
            results("stability/map.png"),
            caption="../../docs/captions/stability.rst",
            category="Stability",
        ),
        curves=results("stability/curves.png"),
        vectors=vectors("stability/map.png", "stability/curves.png"),
    log:
        logs("stability_figures"),
    benchmark:
        benchmarks("stability_figures")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    message:
        said("map and curves")
    script:
        "../../scripts/stability_figures.py"


rule stability_verdict:
    input:
        points=results("stability/points.csv"),
        code=code("stability_verdict"),
    output:
        model=results("stability/verdict_model.json"),
        rates=results("stability/verdict.csv"),
    log:
        logs("stability_verdict"),
    benchmark:
        benchmarks("stability_verdict")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    message:
        said("which signals go with failures")
    script:
        "../../scripts/stability_verdict.py"
