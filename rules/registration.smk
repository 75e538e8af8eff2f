"""
Registration: where the tree's frame lies, and how far the loggers' clock is off.

Needs   nothing; to be fitted structure/polygons/, sensors, their records and radiation
Makes   registration/registration.json   origin of the tree's frame, clock offset
"""


rule registration:
    input:
        leaves=leaf_meshes("polygons") if settings.registration.fit else [],
        wood=results("structure/polygons/wood.ply") if settings.registration.fit else [],
        sensors=data(settings.sensors.path) if settings.registration.fit else [],
        measured=data_files(settings.measured.path) if settings.registration.fit else [],
        radiation=(
            data(settings.radiation.path)
            if settings.registration.fit and settings.radiation.kind == "table"
            else []
        ),
        code=code("registration"),
    output:
        registration=results("registration/registration.json"),
    log:
        logs("registration"),
    benchmark:
        benchmarks("registration")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=4000,
    params:
        **dict(settings.registration),
        **(SKY if settings.registration.fit else {}),
        sensors=settings.sensors.table(),
        records=settings.measured.table(),
        variant=f"{VARIANT}_rgb",
        seed=stream("registration"),
    message:
        said("origin of the tree's frame and offset of the clock")
    script:
        "../scripts/registration.py"
