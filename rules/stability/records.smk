"""
Records: a run's own records made worse. Not part of a plain run.

Needs   light/, structure/, sky/ and statistics/records.csv
Makes   stability/records.csv             agreement and signals of every level of wrong clocks and places
"""

if WORSENED:

    rule stability_records:
        input:
            records=results("statistics/records.csv"),
            light=[results(f"light/{name}.nc") for name in WORSENED],
            leaves=leaf_meshes("polygons") if "polygons" in WORSENED else [],
            surfels=leaf_meshes("surfels") if "surfels" in WORSENED else [],
            wood=results("structure/polygons/wood.ply"),
            voxels=[
                results(f"structure/{name}/voxels.nc")
                for name in WORSENED
                if name.startswith("voxels_")
            ],
            sky=results("sky/sky.nc"),
            sensors=results("sky/sensors.csv"),
            ground=GROUND,
            shade=SHADE,
            code=code("stability_records"),
        output:
            records=results("stability/records.csv"),
        log:
            logs("stability_records"),
        benchmark:
            benchmarks("stability_records")
        conda:
            "../../envs/stability.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            reconstructions=WORSENED,
            levels=STABILITY.levels,
            seeds=STABILITY.seeds,
            ground_z_m=GROUND_Z_M,
            variant=f"{VARIANT}_mono",
            sun_diameter_deg=settings.light.sun_diameter_deg,
            aperture_m=settings.light.entrance_m,
            response=RESPONSE,
            seed=stream("stability_records"),
        message:
            said("its own records made worse")
        script:
            "../../scripts/stability_records.py"
