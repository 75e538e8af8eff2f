"""
Survey: where to put a scanner, and how far to trust what it did not see.

Needs   nothing (virtual stands); for `coverage` scan/shots.parquet
Makes   survey/{stand}_{replicate}/truth.nc          leaf and wood area of every voxel
        survey/{stand}_{replicate}/{design}.nc       voxels hit and passed, at every density
        survey/{stand}_{replicate}/{design}_cells.nc plant area density by likelihood
        survey/{stand}_{replicate}/candidates.nc     voxels seen from each candidate position
        survey/shadowing.csv, filled_profile.csv     relative shadow, profiles of filled voxels
        survey/regression.csv, profile.csv, ...      contact frequency and its correction
        survey/plan.csv, positions.csv               the planner's positions against designs
        survey/*.png                                 figures
        survey/variants.csv                          on request: other leaves, beams and rules
        survey/next.csv                             on request: where to scan next
        survey/coverage.csv                          on request: coverage classes of a real scan
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
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        positions_m=lambda wildcards: stand_settings(wildcards)["positions_m"],
        size_m=lambda wildcards: stand_settings(wildcards)["size_m"],
        leaf_area_index=lambda wildcards: stand_settings(wildcards)["leaf_area_index"],
        n_grown=lambda wildcards: stand_settings(wildcards)["n_grown"],
        seed=lambda wildcards: stand_settings(wildcards)["seed"],
        voxel_size_m=SURVEY.voxel_size_m,
    message:
        "{settings.experiment}: grow {wildcards.stand} stand {wildcards.replicate}"
    script:
        "../scripts/survey_stand.py"


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
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=3000,
    params:
        stand=stand_settings,
        scanner=SCANNER,
        seed=lambda wildcards: stream("survey", "scan", *wildcards),
        positions_m=SURVEY.positions_m,
        height_m=SURVEY.height_m,
        voxel_size_m=SURVEY.voxel_size_m,
        cell_size_m=SURVEY.cell_size_m,
        density_step_deg=SURVEY.density_step_deg,
    message:
        "{settings.experiment}: scan {wildcards.stand} stand {wildcards.replicate}, {wildcards.design}"
    script:
        "../scripts/survey_scan.py"


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
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=3000,
    params:
        stand=stand_settings,
        scanner=SCANNER,
        seed=lambda wildcards: stream("survey", "candidates", *wildcards),
        height_m=SURVEY.height_m,
        voxel_size_m=SURVEY.voxel_size_m,
        along=SURVEY.candidates,
    message:
        "{settings.experiment}: scan {wildcards.stand} stand {wildcards.replicate} from everywhere"
    script:
        "../scripts/survey_candidates.py"


rule survey_shadowing:
    input:
        truth=survey_files("truth", STANDS),
        reach=survey_files("{}", SCANS),
        code=code("survey_shadowing"),
    output:
        shadowing=results("survey/shadowing.csv"),
        profile=results("survey/filled_profile.csv"),
        maps=results("survey/shadow_maps.npz"),
    log:
        logs("survey_shadowing"),
    benchmark:
        benchmarks("survey_shadowing")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        truths=STANDS,
        runs=SCANS,
        per_edge=round(SURVEY.cell_size_m / SURVEY.voxel_size_m),
    message:
        "{settings.experiment}: relative shadow"
    script:
        "../scripts/survey_shadowing.py"


rule survey_correction:
    input:
        truth=survey_files("truth", STANDS),
        reach=survey_files("{}", SCANS),
        cells=survey_files("{}_cells", SCANS),
        code=code("survey_correction"),
    output:
        regression=results("survey/regression.csv"),
        factors=results("survey/factors.csv"),
        profile=results("survey/profile.csv"),
        correction=results("survey/correction.csv"),
        estimators=results("survey/estimators.csv"),
    log:
        logs("survey_correction"),
    benchmark:
        benchmarks("survey_correction")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        truths=STANDS,
        runs=SCANS,
        per_edge=round(SURVEY.cell_size_m / SURVEY.voxel_size_m),
        cell_size_m=SURVEY.cell_size_m,
        range_m=SURVEY.kriging_range_m,
        neighbours=SURVEY.kriging_neighbours,
    message:
        "{settings.experiment}: contact frequency and its correction"
    script:
        "../scripts/survey_correction.py"


rule survey_plan:
    input:
        truth=survey_files("truth", STANDS),
        candidates=survey_files("candidates", STANDS),
        cells=survey_files("single_cells", STANDS),
        code=code("survey_plan"),
    output:
        plan=results("survey/plan.csv"),
        positions=results("survey/positions.csv"),
    log:
        logs("survey_plan"),
    benchmark:
        benchmarks("survey_plan")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=2000,
    params:
        truths=STANDS,
        volume_m=SURVEY.volume_m,
        scans=SURVEY.plan_scans,
        range_m=SURVEY.kriging_range_m,
        neighbours=SURVEY.kriging_neighbours,
    message:
        "{settings.experiment}: plan the next scans"
    script:
        "../scripts/survey_plan.py"


rule survey_figures:
    input:
        shadowing=results("survey/shadowing.csv"),
        filled=results("survey/filled_profile.csv"),
        maps=results("survey/shadow_maps.npz"),
        regression=results("survey/regression.csv"),
        profile=results("survey/profile.csv"),
        plan=results("survey/plan.csv"),
        code=code("survey_figures"),
    output:
        shadowing=results("survey/shadowing.png"),
        filled=results("survey/filled_profile.png"),
        maps=results("survey/shadow_maps.png"),
        regression=results("survey/regression.png"),
        profile=results("survey/profile.png"),
        plan=results("survey/plan.png"),
    log:
        logs("survey_figures"),
    benchmark:
        benchmarks("survey_figures")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        cell_size_m=SURVEY.cell_size_m,
    message:
        "{settings.experiment}: figures of the survey"
    script:
        "../scripts/survey_figures.py"


rule survey_coverage:
    input:
        shots=results("scan/shots.parquet"),
        code=code("survey_coverage"),
    output:
        classes=results("survey/coverage.csv"),
        summary=results("survey/coverage.json"),
    log:
        logs("survey_coverage"),
    benchmark:
        benchmarks("survey_coverage")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=4000,
    params:
        voxel_size_m=SURVEY.voxel_size_m,
        cell_size_m=SURVEY.cell_size_m,
        range_m=SURVEY.kriging_range_m,
        neighbours=SURVEY.kriging_neighbours,
    message:
        "{settings.experiment}: how well the real scan covers its surroundings"
    script:
        "../scripts/survey_coverage.py"


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
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=3000,
    params:
        stands={stand: grown(stand, 1) for stand in SURVEY.stands},
        scanner=SCANNER | {"azimuth_steps_deg": (0.5, 0.1, 0.02)},
        height_m=SURVEY.height_m,
        voxel_size_m=SURVEY.voxel_size_m,
        cell_size_m=SURVEY.cell_size_m,
        seed=stream("survey", "variants"),
    message:
        "{settings.experiment}: what makes shadow"
    script:
        "../scripts/survey_variants.py"


rule survey_next:
    input:
        **PLANNED_FROM,
        code=code("survey_next"),
    output:
        next=results("survey/next.csv"),
    log:
        logs("survey_next"),
    benchmark:
        benchmarks("survey_next")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=2000,
    params:
        along=SURVEY.candidates,
        scans=SURVEY.plan_scans,
        height_m=SURVEY.height_m,
        cell_size_m=SURVEY.cell_size_m,
        voxel_size_m=SURVEY.voxel_size_m,
        zenith_step_deg=SURVEY.zenith_step_deg,
        azimuth_step_deg=max(SURVEY.azimuth_steps_deg),
        range_m=SURVEY.kriging_range_m,
        neighbours=SURVEY.kriging_neighbours,
    message:
        "{settings.experiment}: where to scan next"
    script:
        "../scripts/survey_next.py"
