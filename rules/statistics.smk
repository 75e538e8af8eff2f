"""
Statistics: how well simulated light matches measured light, and what it cost.

Needs   light/{reconstruction}.nc and the records, or the virtual truth
Makes   statistics/records.json       what was read of the records, and what was noticed
        statistics/records.csv        measured and simulated PAR side by side, between which bounds 90 % of
                                      records are expected, fitting and reporting part named
        statistics/overall.csv        one line a reconstruction, reporting part only
        statistics/per_sensor.csv     one line a sensor
        statistics/agreement.csv      engines of light against each other
        statistics/mixed_model.csv    measured on simulated light, sensor as random effect
        runtime.csv                   time and memory of every step
"""


rule records:
    input:
        light=[results(f"light/{name}.nc") for name in COMPARED],
        truth=results("light/truth.nc") if settings.measured.kind == "virtual" else [],
        measured=(
            data_files(settings.measured.path)
            if settings.measured.kind == "table"
            else []
        ),
        sensors=results("sky/sensors.csv"),
        sky=results("sky/sky.nc"),
        registration=FITTED,
        errors=beside_code("stats/reconstruction_errors.csv"),
        code=code("records"),
    output:
        records=results("statistics/records.csv"),
        facts=results("statistics/records.json"),
    log:
        logs("records"),
    benchmark:
        benchmarks("records")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        kind=settings.measured.kind,
        table=settings.measured.table(),
        sensor_model=settings.measured.sensor_model(),
        sensor_error=settings.measured.sensor_error(),
        leaves_by_chance=settings.source == "wood",
        response=RESPONSE,
        reconstructions=COMPARED,
        seed=stream("records"),
    message:
        said("measured beside simulated light")
    script:
        "../scripts/records.py"


rule record_statistics:
    input:
        records=results("statistics/records.csv"),
        code=code("record_statistics"),
    output:
        overall=report(
            results("statistics/overall.csv"),
            caption="../docs/captions/overall.rst",
            category="Statistics",
        ),
        per_sensor=results("statistics/per_sensor.csv"),
        mixed_model=results("statistics/mixed_model.csv"),
    log:
        logs("record_statistics"),
    benchmark:
        benchmarks("record_statistics")
    conda:
        "../envs/statistics.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        **dict(settings.statistics),
        seed=stream("statistics"),
    message:
        said("correlation, error, bias")
    script:
        "../scripts/record_statistics.py"


rule agreement:
    input:
        transport=[results(f"light/{name}.nc") for name in CHECKED],
        timestep=[
            results(f"light/reference/{name}.nc")
            for name in (CHECKED if "timestep" in CHECK_WITH else ())
        ],
        less=[
            results(f"light/less/{name}.nc")
            for name in (CHECKED if "less" in CHECK_WITH else ())
        ],
        sky=results("sky/sky.nc"),
        code=code("agreement"),
    output:
        agreement=results("statistics/agreement.csv"),
    log:
        logs("agreement"),
    benchmark:
        benchmarks("agreement")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    params:
        reconstructions=CHECKED,
        engines=["transport", *CHECK_WITH],
        response=RESPONSE,
    message:
        said("the light of {params.engines} compared")
    script:
        "../scripts/agreement.py"


rule runtime:
    input:
        made=[
            path
            for path in targets()
            if not path.endswith(("runtime.csv", "report.html"))
        ],
        code=code("runtime"),
    output:
        runtime=results("runtime.csv"),
    log:
        logs("runtime"),
    benchmark:
        benchmarks("runtime")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    params:
        reconstructions=settings.reconstructions,
    message:
        said("time and memory of every step")
    script:
        "../scripts/runtime.py"
