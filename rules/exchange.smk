"""
Exchange: scenes for other light models, and from them; made on demand.

Needs   structure/{reconstruction}/, sky/sky.nc, sky/optics.nc, sky/sensors.csv; or exchange.scene
Makes   export/{reconstruction}/exchange/   scene, sensors and light at the highest sun, as glTF and
                                            scene.json
        exchange/light.csv                  light at the sensors of the scene of exchange.scene
"""


rule export_exchange:
    input:
        leaves=lambda wildcards: leaf_geometry(wildcards)[:1],
        wood=wood_mesh,
        sky=results("sky/sky.nc"),
        optics=results("sky/optics.nc"),
        sensors=results("sky/sensors.csv"),
        ground=GROUND,
        shade=SHADE,
        code=code("export_exchange"),
    output:
        folder=directory(results("export/{reconstruction}/exchange")),
    log:
        logs("export_exchange_{reconstruction}"),
    benchmark:
        benchmarks("export_exchange_{reconstruction}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        aperture_m=OF_BEAM["aperture_m"],
        ground_z_m=GROUND_Z_M,
        sensor_table=SENSOR_TABLE,
        description=f"{settings.experiment}, as dapple has it",
    message:
        said("{wildcards.reconstruction} as glTF and scene.json")
    script:
        "../scripts/export_exchange.py"


if settings.exchange.scene:

    rule exchange:
        input:
            scene=data(settings.exchange.scene),
            code=code("exchange_light"),
        output:
            light=results("exchange/light.csv"),
        log:
            logs("exchange"),
        benchmark:
            benchmarks("exchange")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            rays={
                "replicates": settings.light.timestep.replicates,
                "direct": settings.light.timestep.direct_rays,
                "sky": settings.light.timestep.sky_rays,
                "scattered": settings.light.timestep.scattered_rays,
                "max_depth": settings.light.timestep.max_depth,
            },
            sun_diameter_deg=settings.light.sun_diameter_deg,
            variant=f"{VARIANT}_rgb",
            response=RESPONSE,
            seed=stream("exchange"),
        message:
            said("light of a scene that was exchanged")
        script:
            "../scripts/exchange_light.py"
