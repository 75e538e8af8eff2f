"""
Plan: where to scan next, and how well a real scan covers its surroundings.

Needs   survey/{stand}_{replicate}/; for `survey_next` and `survey_coverage` scan/shots.parquet
Makes   survey/plan.csv, positions.csv               the planner's positions against designs
        survey/next.csv                              on request: where to scan next
        survey/coverage.csv                          on request: coverage classes of a real scan
"""


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
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(2000),
    params:
        truths=STANDS,
        volume_m=SURVEY.volume_m,
        scans=SURVEY.plan_scans,
        range_m=SURVEY.kriging_range_m,
        neighbours=SURVEY.kriging_neighbours,
    message:
        said("plan the next scans")
    script:
        "../../scripts/survey_plan.py"


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
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(2000),
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
        said("where to scan next")
    script:
        "../../scripts/survey_next.py"


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
        "../../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(4000),
    params:
        voxel_size_m=SURVEY.voxel_size_m,
        cell_size_m=SURVEY.cell_size_m,
        range_m=SURVEY.kriging_range_m,
        neighbours=SURVEY.kriging_neighbours,
    message:
        said("how well the real scan covers its surroundings")
    script:
        "../../scripts/survey_coverage.py"
