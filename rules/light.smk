"""
Light: what arrives at the sensors.

Needs   structure/{reconstruction}/, sky/sky.nc, sky/optics.nc, sky/sensors.csv
Makes   registration/registration.json                  origin of the tree's frame, clock offset
        light/timesteps/{reconstruction}/{time}.nc      one cached file a timestep
        light/{reconstruction}.nc                       the series of all times
        light/ground_map.nc                             light on the ground at a few times
"""


rule registration:
    input:
        leaves=leaf_meshes("polygons") if settings.registration.fit else [],
        wood=results("structure/polygons/wood.ply") if settings.registration.fit else [],
        sensors=data(settings.sensors.path) if settings.registration.fit else [],
        measured=data(settings.measured.path) if settings.registration.fit else [],
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
        variant=VARIANT,
        seed=stream("registration"),
    message:
        "{settings.experiment}: origin of the tree's frame and offset of the clock"
    script:
        "../scripts/registration.py"


rule timesteps:
    input:
        leaves=leaf_geometry,
        wood=wood_mesh,
        sky=results("sky/sky.nc"),
        optics=results("sky/optics.nc"),
        sensors=results("sky/sensors.csv"),
        code=code("timesteps"),
    output:
        # Kept when the rule runs again: the script recomputes only those whose inputs changed.
        times=update(
            expand(
                results("light/timesteps/{reconstruction}/{time}.nc"),
                time=TIMES,
                allow_missing=True,
            )
        ),
    log:
        logs("timesteps_{reconstruction}"),
    benchmark:
        benchmarks("timesteps_{reconstruction}")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=4000,
    params:
        engine=ENGINE,
        ground_z_m=settings.ground_z_m,
        n_times=len(TIMES),
        seed=stream("timesteps"),
    message:
        "{settings.experiment}: Mitsuba, {wildcards.reconstruction}, {params.n_times} times"
    script:
        "../scripts/timesteps.py"


rule light:
    input:
        times=expand(
            results("light/timesteps/{reconstruction}/{time}.nc"),
            time=TIMES,
            allow_missing=True,
        ),
        code=code("light"),
    output:
        light=results("light/{reconstruction}.nc"),
    log:
        logs("light_{reconstruction}"),
    benchmark:
        benchmarks("light_{reconstruction}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    message:
        "{settings.experiment}: light series, {wildcards.reconstruction}"
    script:
        "../scripts/light.py"


rule ground_map:
    input:
        leaves=leaf_meshes("polygons"),
        wood=results("structure/polygons/wood.ply"),
        sky=results("sky/sky.nc"),
        optics=results("sky/optics.nc"),
        code=code("ground_map"),
    output:
        map=results("light/ground_map.nc"),
    log:
        logs("ground_map"),
    benchmark:
        benchmarks("ground_map")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=4000,
    params:
        times=settings.figures.map_times,
        spacing_m=settings.figures.map_spacing_m,
        margin_m=settings.figures.map_margin_m,
        engine=ENGINE,
        ground_z_m=settings.ground_z_m,
        seed=stream("ground_map"),
    message:
        "{settings.experiment}: light on the ground around the tree"
    script:
        "../scripts/ground_map.py"
