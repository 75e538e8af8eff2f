"""
Shadowing: what scans did not see, and how contact frequency is corrected for it.

Needs   survey/{stand}_{replicate}/truth.nc, {design}.nc, {design}_cells.nc; for the figures survey/plan.csv
Makes   survey/shadowing.csv, filled_profile.csv     relative shadow, profiles of filled voxels
        survey/regression.csv, profile.csv, ...      contact frequency and its correction
        survey/*.png, *.pdf                          figures
"""


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
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        truths=STANDS,
        runs=SCANS,
        per_edge=round(SURVEY.cell_size_m / SURVEY.voxel_size_m),
    message:
        said("relative shadow")
    script:
        "../../scripts/survey_shadowing.py"


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
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        truths=STANDS,
        runs=SCANS,
        per_edge=round(SURVEY.cell_size_m / SURVEY.voxel_size_m),
        cell_size_m=SURVEY.cell_size_m,
        range_m=SURVEY.kriging_range_m,
        neighbours=SURVEY.kriging_neighbours,
    message:
        said("contact frequency and its correction")
    script:
        "../../scripts/survey_correction.py"


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
        vectors=vectors(
            *(
                f"survey/{name}.png"
                for name in (
                    "shadowing",
                    "filled_profile",
                    "shadow_maps",
                    "regression",
                    "profile",
                    "plan",
                )
            )
        ),
    log:
        logs("survey_figures"),
    benchmark:
        benchmarks("survey_figures")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        cell_size_m=SURVEY.cell_size_m,
    message:
        said("figures of the survey")
    script:
        "../../scripts/survey_figures.py"
