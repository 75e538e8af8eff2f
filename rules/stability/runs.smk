"""
Runs: virtual worlds, undisturbed and with one thing at a time made worse.

Needs   the configuration
Makes   stability/base/{world}/           a world, its undisturbed scan and run, shared by batches
        stability/batches/                one table a stressor and world: all its levels
"""


rule stability_base:
    input:
        code=code("stability_base"),
    output:
        leaves=results("stability/base/{world}/leaves.ply"),
        wood=results("stability/base/{world}/wood.ply"),
        shots=results("stability/base/{world}/shots.parquet"),
        cloud=results("stability/base/{world}/cloud.ply"),
        seconds=results("stability/base/{world}/seconds.json"),
        undisturbed=results("stability/base/{world}/undisturbed.csv"),
    log:
        logs("stability_base_{world}"),
    benchmark:
        benchmarks("stability_base_{world}")
    wildcard_constraints:
        world="[0-9]+",
    conda:
        "../../envs/stability.yaml"
    threads: 1
    resources:
        mem_mb=memory(3000),
    params:
        setup=stability_setup(),
        reconstructions=STABILITY_RECONSTRUCTIONS,
        seed=stability_seed,
    message:
        said("world {wildcards.world}, undisturbed")
    script:
        "../../scripts/stability_base.py"


rule stability_batch:
    input:
        unpack(stability_base),
        code=code("stability_batch"),
    output:
        batch=results("stability/batches/{stressor}_{world}.csv"),
    log:
        logs("stability_{stressor}_{world}"),
    benchmark:
        benchmarks("stability_{stressor}_{world}")
    wildcard_constraints:
        stressor="[a-z_]+",
        world="[0-9]+",
    conda:
        "../../envs/stability.yaml"
    threads: 1
    resources:
        mem_mb=stability_memory,
    params:
        setup=stability_setup(),
        reconstructions=STABILITY_RECONSTRUCTIONS,
        levels=STABILITY.levels,
        seed=stability_seed,
    message:
        said("{wildcards.stressor}, world {wildcards.world}")
    script:
        "../../scripts/stability_batch.py"
