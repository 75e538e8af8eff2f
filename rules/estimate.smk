"""
Estimate: how long a run will take on this machine, with how much memory, before it begins.

Needs   the configuration, headers of the files that it names
Makes   machine.json   how fast this machine is, from ten seconds of work; delete it to measure again

`snakemake -- estimate` prints the rest. A run begins with one sentence on what it will do and why.
"""


rule machine:
    input:
        code=code("machine"),
    output:
        speed=results("machine.json"),
    log:
        logs("machine"),
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    message:
        said("how fast this machine is: ten seconds of work")
    script:
        "../scripts/machine.py"


# It asks Snakemake what a run would do.
rule estimate:
    input:
        speed=results("machine.json"),
        code=code("estimate"),
    log:
        logs("estimate"),
    conda:
        "../envs/estimate.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    params:
        snakefile=str(HOME / "Snakefile"),
        settings=settings.model_dump(mode="json"),
        cores=lambda wildcards: workflow.cores or 1,
        known=lambda wildcards: known_before(),
    message:
        said("what a run would take")
    script:
        "../scripts/estimate.py"
