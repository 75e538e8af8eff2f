"""
Registration: where the tree's frame lies, and how far the loggers' clock is off.

Needs   structure/polygons/, sensors, their records and radiation
Makes   registration/registration.json   origin of the tree's frame, clock offset, if they are to be fitted
"""

if settings.registration.fit:

    rule registration:
        input:
            leaves=leaf_meshes("polygons"),
            wood=results("structure/polygons/wood.ply"),
            sensors=data(settings.sensors.path),
            measured=data_files(settings.measured.path),
            radiation=(
                data(settings.radiation.path)
                if settings.radiation.kind == "table"
                else []
            ),
            sky_table=sky_table(),
            frame=OWN_FRAME,
            ground=GROUND,
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
            mem_mb=memory(4000),
        params:
            **settings.registration.model_dump(exclude={"fit"}),
            **SKY,
            sensors=settings.sensors.table(),
            records=settings.measured.table(),
            sun_diameter_deg=settings.light.sun_diameter_deg,
            aperture_m=settings.light.entrance_m,
            response=RESPONSE,
            ground_z_m=GROUND_Z_M,
            variant=f"{VARIANT}_rgb",
            seed=stream("registration"),
        message:
            said("origin of the tree's frame and offset of the clock")
        script:
            "../scripts/registration.py"
