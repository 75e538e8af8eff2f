"""
Provenance: what a run read and made, with checksums, for who publishes it. Made on request alone.

Needs   all results of the run
Makes   ro-crate-metadata.json   an RO-Crate: every file with its SHA-256, programs with their versions
"""


rule crate:
    input:
        made=targets(),
        data=DATA_FILES,
        code=code("crate"),
    output:
        crate=results("ro-crate-metadata.json"),
    log:
        logs("crate"),
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    params:
        experiment=settings.experiment,
    message:
        said("checksums and versions of the run, as an RO-Crate")
    script:
        "../scripts/crate.py"
