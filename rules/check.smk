"""
Check: what the input holds, what is wrong with it, and what can be made of it, before any long job.

Needs   the files that the configuration names
Makes   check.json, check.html   facts and findings, each with the lines of YAML that mend it

`snakemake check` prints them on one page. A run begins with the same look and stops at errors, in
`rule ingest`: were check.json its input, each edit that changes the look would read the cloud anew.
"""

INPUT = {
    "cloud": data(settings.cloud.path) if settings.source == "cloud" else [],
    "positions": (
        data(settings.cloud.scan_positions) if settings.cloud.scan_positions else []
    ),
    "sensors": data(settings.sensors.path) if settings.sensors.kind == "table" else [],
}


rule inspect_input:
    input:
        **INPUT,
        code=code("inspect_input"),
    output:
        json=results("check.json"),
        html=results("check.html"),
    log:
        logs("inspect_input"),
    benchmark:
        benchmarks("inspect_input")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(4000),
    params:
        **settings.model_dump(
            include={
                "experiment",
                "reconstructions",
                "ground_z_m",
                "cloud",
                "tree",
                "classify",
                "polygons",
                "sensors",
                "measured",
                "registration",
            }
        ),
    message:
        said("look at the input")
    script:
        "../scripts/inspect_input.py"


rule check:
    input:
        found=results("check.json"),
        code=code("check"),
    log:
        logs("check"),
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    message:
        said("what was found in the input")
    script:
        "../scripts/check.py"
