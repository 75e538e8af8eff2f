"""
Sky: what light reaches the tree, and what leaf, bark and meadow do with it.

Needs   the configuration; with radiation.kind: table, global and diffuse irradiance
Makes   sky/sky.nc         sun, direct and diffuse photon flux per band, sky radiance coefficients
        sky/radiation.json what was read of radiation, what was noticed, what was modelled
        sky/optics.nc      reflectance and transmittance per band
        sky/optics.json    what was noticed about spectra
        sky/sensors.csv    the sensors in the local frame
"""


rule sky:
    input:
        radiation=(
            data(settings.radiation.path) if settings.radiation.kind == "table" else []
        ),
        sky_table=sky_table(),
        registration=FITTED,
        code=code("sky"),
    output:
        sky=results("sky/sky.nc"),
        radiation=results("sky/radiation.json"),
    log:
        logs("sky"),
    benchmark:
        benchmarks("sky")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        **SKY,
        time=dict(settings.time),
        n_times=N_TIMES,
    message:
        said("sun and sky at {params.n_times} times")
    script:
        "../scripts/sky.py"


rule optics:
    input:
        tables=[
            data(s.path)
            for s in (
                settings.optics.leaf,
                settings.optics.bark,
                settings.optics.ground,
            )
            if s.path
        ],
        code=code("optics"),
    output:
        optics=results("sky/optics.nc"),
        facts=results("sky/optics.json"),
    log:
        logs("optics"),
    benchmark:
        benchmarks("optics")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    params:
        **OPTICS,
    message:
        said("spectra of leaf, bark and ground")
    script:
        "../scripts/optics.py"


rule sensors:
    input:
        table=data(settings.sensors.path) if settings.sensors.kind == "table" else [],
        frame=(FITTED or OWN_FRAME) if settings.sensors.kind == "table" else [],
        wood=stem_wood(),
        ground=GROUND,
        code=code("sensors"),
    output:
        sensors=results("sky/sensors.csv"),
    log:
        logs("sensors"),
    benchmark:
        benchmarks("sensors")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        kind=settings.sensors.kind,
        table=settings.sensors.table(),
        grid=settings.sensors.grid(),
        facing=settings.sensors.facing(),
        origin_m=(
            settings.registration.origin_m
            if settings.sensors.kind == "table"
            else None
        ),
        ground_z_m=GROUND_Z_M,
    message:
        said("sensors in the local frame")
    script:
        "../scripts/sensors.py"
