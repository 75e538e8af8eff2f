"""
Scans: virtual stands, and what scans by several designs see of them.

Needs   nothing
Makes   survey/{stand}_{replicate}/truth.nc          leaf and wood area of every voxel
        survey/{stand}_{replicate}/{design}.nc       voxels hit and passed, at every density
        survey/{stand}_{replicate}/{design}_cells.nc plant area density by likelihood
        survey/{stand}_{replicate}/candidates.nc     voxels hit from each candidate position
        survey/variants.csv                          on request: other leaves, beams and rules
"""


rule survey_stand:
    input:
        code=code("survey_stand"),
    output:
        truth=results("survey/{stand}_{replicate}/truth.nc"),
    log:
        logs("survey_stand_{stand}_{replicate}"),
    benchmark:
        benchmarks("survey_stand_{stand}_{replicate}")
    wildcard_constraints:
        stand="[a-z]+",
        replicate="[0-9]+",
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        positions_m=lambda wildcards: stand_settings(wildcards)["positions_m"],
        size_m=lambda wildcards: stand_settings(wildcards)["size_m"],
        leaf_area_index=lambda wildcards: stand_settings(wildcards)["leaf_area_index"],
        n_grown=lambda wildcards: stand_settings(wildcards)["n_grown"],
        seed=lambda wildcards: stand_settings(wildcards)["seed"],
        voxel_size_m=SURVEY.voxel_size_m,
    message:
        said("grow {wildcards.stand} stand {wildcards.replicate}")
    script:
        "../../scripts/survey_stand.py"


rule survey_scan:
    input:
        code=code("survey_scan"),
    output:
        reach=results("survey/{stand}_{replicate}/{design}.nc"),
        cells=results("survey/{stand}_{replicate}/{design}_cells.nc"),
    log:
        logs("survey_scan_{stand}_{replicate}_{design}"),
    benchmark:
        benchmarks("survey_scan_{stand}_{replicate}_{design}")
    wildcard_constraints:
        stand="[a-z]+",
        replicate="[0-9]+",
        design="single|diamond|corners|list",
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(3000),
    params:
        stand=stand_settings,
        scanner=SURVEY.scanner,
        seed=lambda wildcards: stream("survey", "scan", *wildcards),
        positions_m=SURVEY.positions_m,
        height_m=SURVEY.height_m,
        voxel_size_m=SURVEY.voxel_size_m,
        cell_size_m=SURVEY.cell_size_m,
        density_step_deg=SURVEY.density_step_deg,
    message:
        said("scan {wildcards.stand} stand {wildcards.replicate}, {wildcards.design}")
    script:
        "../../scripts/survey_scan.py"


rule survey_candidates:
    input:
        code=code("survey_candidates"),
    output:
        reach=results("survey/{stand}_{replicate}/candidates.nc"),
    log:
        logs("survey_candidates_{stand}_{replicate}"),
    benchmark:
        benchmarks("survey_candidates_{stand}_{replicate}")
    wildcard_constraints:
        stand="[a-z]+",
        replicate="[0-9]+",
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(3000),
    params:
        stand=stand_settings,
        scanner=SURVEY.scanner,
        seed=lambda wildcards: stream("survey", "candidates", *wildcards),
        height_m=SURVEY.height_m,
        voxel_size_m=SURVEY.voxel_size_m,
        along=SURVEY.candidates,
    message:
        said("scan {wildcards.stand} stand {wildcards.replicate} from everywhere")
    script:
        "../../scripts/survey_candidates.py"


rule survey_variants:
    input:
        code=code("survey_variants"),
    output:
        variants=results("survey/variants.csv"),
    log:
        logs("survey_variants"),
    benchmark:
        benchmarks("survey_variants")
    conda:
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(3000),
    params:
        stands={stand: grown(stand, 1) for stand in SURVEY.stands},
        scanner=SURVEY.scanner | {"azimuth_steps_deg": (0.5, 0.1, 0.02)},
        height_m=SURVEY.height_m,
        voxel_size_m=SURVEY.voxel_size_m,
        cell_size_m=SURVEY.cell_size_m,
        seed=stream("survey", "variants"),
    message:
        said("what makes shadow")
    script:
        "../../scripts/survey_variants.py"
