"""
Light: what arrives at the sensors.

Needs   structure/{reconstruction}/, sky/sky.nc, sky/optics.nc, sky/sensors.csv; light/model.json where
        light.model is advised
Makes   light/transport/{reconstruction}_{placement}.nc counted paths: any sky, spectrum and time
        light/sun/{reconstruction}.nc                   what sensors see of the sun
        light/{reconstruction}.nc                       the series of all times
        light/timesteps/{reconstruction}/{batch}.nc     the independent check, some times in each file
        light/reference/{reconstruction}.nc             its series
        light/less_timesteps/{reconstruction}/{batch}.nc
        light/less/{reconstruction}.nc                  the same by LESS 3, another independent check
        light/ground_map.nc, .tif                       light on the ground, hour by hour
        light/ground_sum.tif                            the same, summed over the day
        export/{reconstruction}/                        the scene for LESS 3 (`less3/`) and as glTF (`scene.glb`)
"""


rule timesteps:
    input:
        leaves=leaf_geometry,
        wood=wood_mesh,
        sky=results("sky/sky.nc"),
        optics=results("sky/optics.nc"),
        sensors=results("sky/sensors.csv"),
        ground=GROUND,
        shade=SHADE,
        code=code("timesteps"),
    output:
        light=results("light/timesteps/{reconstruction}/{batch}.nc"),
    log:
        logs("timesteps/{reconstruction}/{batch}"),
    benchmark:
        benchmarks("timesteps/{reconstruction}/{batch}")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(4000),
    params:
        engine=REFERENCE,
        ground_z_m=GROUND_Z_M,
        sensor_table=SENSOR_TABLE,
        times=REFERENCE_TIMES,
        positions=timestep_positions,
        n_positions=lambda wildcards: len(timestep_positions(wildcards)),
        seed=stream("timesteps"),
    message:
        said("Mitsuba, {wildcards.reconstruction}, {params.n_positions} times")
    script:
        "../scripts/timesteps.py"


rule reference:
    input:
        times=expand(
            results("light/timesteps/{reconstruction}/{batch}.nc"),
            batch=REFERENCE_BATCHES,
            allow_missing=True,
        ),
        sensors=results("sky/sensors.csv"),
        cloud=WORLD_OF_CLOUD,
        registration=FITTED,
        code=code("reference"),
    output:
        light=(
            results("light/{reconstruction}.nc")
            if settings.light.engine == "timestep"
            else results("light/reference/{reconstruction}.nc")
        ),
    log:
        logs("reference_{reconstruction}"),
    benchmark:
        benchmarks("reference_{reconstruction}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        world=WORLD,
    message:
        said("series of the timesteps, {wildcards.reconstruction}")
    script:
        "../scripts/reference.py"


rule less_timesteps:
    input:
        leaves=leaf_geometry,
        wood=wood_mesh,
        sky=results("sky/sky.nc"),
        optics=results("sky/optics.nc"),
        sensors=results("sky/sensors.csv"),
        ground=GROUND,
        shade=SHADE,
        runner=beside_code("light/less_run.py"),
        code=code("less_timesteps"),
    output:
        light=results("light/less_timesteps/{reconstruction}/{batch}.nc"),
    log:
        logs("less_timesteps/{reconstruction}/{batch}"),
    benchmark:
        benchmarks("less_timesteps/{reconstruction}/{batch}")
    conda:
        "../envs/less.yaml"
    threads: 2
    resources:
        mem_mb=memory(4000),
    params:
        engine={"bands": LESS.bands, "aperture_m": OF_BEAM["aperture_m"]},
        rays=LESS_RAYS,
        ground_z_m=GROUND_Z_M,
        sensor_table=SENSOR_TABLE,
        times=lambda wildcards: batch_of(
            less_times(wildcards.reconstruction), wildcards
        ),
        most_sensors=lambda wildcards: (
            LESS.voxel_sensors if is_less_sample(wildcards.reconstruction) else 0
        ),
        seed=lambda wildcards: stream("less", wildcards.batch),
    message:
        said("LESS 3, {wildcards.reconstruction}, times {params.times}")
    script:
        "../scripts/less_timesteps.py"


rule export_scene:
    input:
        leaves=lambda wildcards: leaf_geometry(wildcards)[:1],
        wood=wood_mesh,
        sky=results("sky/sky.nc"),
        optics=results("sky/optics.nc"),
        sensors=results("sky/sensors.csv"),
        ground=GROUND,
        shade=SHADE,
        runner=beside_code("light/less_run.py"),
        code=code("export_scene"),
    output:
        less=directory(results("export/{reconstruction}/less3")),
        gltf=results("export/{reconstruction}/scene.glb"),
    log:
        logs("export_scene_{reconstruction}"),
    benchmark:
        benchmarks("export_scene_{reconstruction}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        rays=LESS_RAYS,
        aperture_m=OF_BEAM["aperture_m"],
        ground_z_m=GROUND_Z_M,
        sensor_table=SENSOR_TABLE,
        seed=stream("export_scene"),
    message:
        said("{wildcards.reconstruction} for LESS 3 and as glTF")
    script:
        "../scripts/export_scene.py"


rule less:
    input:
        times=less_batches,
        sensors=results("sky/sensors.csv"),
        cloud=WORLD_OF_CLOUD,
        registration=FITTED,
        code=code("reference"),
    output:
        light=(
            results("light/{reconstruction}.nc")
            if settings.light.engine == "less"
            else results("light/less/{reconstruction}.nc")
        ),
    log:
        logs("less_{reconstruction}"),
    benchmark:
        benchmarks("less_{reconstruction}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        world=WORLD,
    message:
        said("series of LESS, {wildcards.reconstruction}")
    script:
        "../scripts/reference.py"


if settings.light.engine == "transport":

    rule transport:
        input:
            leaves=lambda wildcards: leaf_geometry(wildcards)[int(wildcards.placement)],
            wood=wood_mesh,
            sensors=results("sky/sensors.csv"),
            model=results("light/model.json") if ADVISED else [],
            ground=GROUND,
            shade=SHADE,
            code=code("transport"),
        output:
            # What it holds of sensors that are as they were is not traced again.
            transport=update(results("light/transport/{reconstruction}_{placement}.nc")),
        log:
            logs("transport/{reconstruction}/{placement}"),
        benchmark:
            benchmarks("transport/{reconstruction}/{placement}")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            model=tracing("sky_patches", "max_orders"),
            tracing=tracing(
                "tolerance",
                "sky_rays",
                "paths",
                "max_growth",
                "sun_kernel_deg",
                "aperture_m",
                "response",
            ),
            tiles=settings.light.tiles.model_dump(),
            ground_z_m=GROUND_Z_M,
            sensor_table=SENSOR_TABLE,
            variant=f"{VARIANT}_mono",
            seed=lambda wildcards: stream("transport", wildcards.placement),
        message:
            said("trace paths, {wildcards.reconstruction} {wildcards.placement}")
        script:
            "../scripts/transport.py"

    rule light:
        input:
            transports=transports,
            leaves=leaf_geometry,
            wood=wood_mesh,
            sensors=results("sky/sensors.csv"),
            sky=results("sky/sky.nc"),
            optics=results("sky/optics.nc"),
            model=results("light/model.json") if ADVISED else [],
            ground=GROUND,
            shade=SHADE,
            cloud=WORLD_OF_CLOUD,
            registration=FITTED,
            code=code("light"),
        output:
            light=results("light/{reconstruction}.nc"),
            sun=update(results("light/sun/{reconstruction}.nc")),
        log:
            logs("light_{reconstruction}"),
        benchmark:
            benchmarks("light_{reconstruction}")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            tracing=tracing(
                "tolerance",
                "max_shadow_rays",
                "sun_kernel_deg",
                "sun_diameter_deg",
                "aperture_m",
                "response",
            ),
            tiles=settings.light.tiles.model_dump(),
            ground_z_m=GROUND_Z_M,
            world=WORLD,
            n_times=N_TIMES,
            variant=f"{VARIANT}_mono",
            seed=stream("light"),
        message:
            said("light series, {wildcards.reconstruction}, {params.n_times} times")
        script:
            "../scripts/light.py"


rule ground_map:
    input:
        leaves=leaf_meshes("polygons"),
        wood=results("structure/polygons/wood.ply"),
        sky=results("sky/sky.nc"),
        optics=results("sky/optics.nc"),
        ground=GROUND,
        shade=SHADE,
        cloud=WORLD_OF_CLOUD,
        registration=FITTED,
        code=code("ground_map"),
    output:
        map=results("light/ground_map.nc"),
        hourly=results("light/ground_map.tif"),
        daily=results("light/ground_sum.tif"),
    log:
        logs("ground_map"),
    benchmark:
        benchmarks("ground_map")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(4000),
    params:
        times=settings.figures.map_times,
        timezone=settings.time.timezone,
        spacing_m=settings.figures.map_spacing_m,
        margin_m=settings.figures.map_margin_m,
        tracing=tracing("sun_diameter_deg", "sun_kernel_deg")
        | {"variant": f"{VARIANT}_mono"},
        ground_z_m=GROUND_Z_M,
        world=WORLD,
        seed=stream("ground_map"),
    message:
        said("light on the ground around the tree")
    script:
        "../scripts/ground_map.py"
