"""
Verdict: how far a run can be trusted, from what it leaves behind alone.

Needs   classes/cloud.laz; scan/shots.parquet, structure/, light/, sky/ and statistics/records.csv as far
        as the run makes them
Makes   verdict.json      green, amber or red for every reconstruction, with reasons and remedies
"""

# Polygons are made with the wood of surfels anyway.
MESHED = {"polygons", "surfels"} & set(JUDGED)


rule verdict:
    input:
        cloud=results("classes/cloud.laz"),
        shots=(results("scan/shots.parquet") if settings.has_shots else []),
        leaves=leaf_meshes("polygons") if MESHED else [],
        wood=(results("structure/polygons/wood.ply") if LIT or MESHED else []),
        surfels=leaf_meshes("surfels") if "surfels" in JUDGED else [],
        surfel_facts=(
            results("structure/surfels/summary.json") if "surfels" in JUDGED else []
        ),
        voxels=[
            results(f"structure/{name}/voxels.nc")
            for name in JUDGED
            if name.startswith("voxels_")
        ],
        light=[results(f"light/{name}.nc") for name in JUDGED if name in LIT],
        sky=results("sky/sky.nc") if LIT else [],
        sensors=results("sky/sensors.csv") if LIT else [],
        records=results("statistics/records.csv") if COMPARED else [],
        model=beside_code("verdict/verdict_model.json"),
        ground=GROUND,
        shade=SHADE,
        code=code("verdict"),
    output:
        verdict=results("verdict.json"),
    log:
        logs("verdict"),
    benchmark:
        benchmarks("verdict")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(4000),
    params:
        reconstructions=JUDGED,
        polygons=(
            settings.polygons.model_dump(include={"voxel_size_m", "leaf_size_m"})
            if settings.source != "wood"
            else None
        ),
        beam={
            "exit_aperture_m": settings.surfels.beam_diameter_m,
            "beam_divergence_mrad": settings.surfels.beam_divergence_mrad,
        },
        ground_z_m=GROUND_Z_M,
        variant=f"{VARIANT}_mono",
        sun_diameter_deg=settings.light.sun_diameter_deg,
        aperture_m=settings.light.entrance_m,
        response=RESPONSE,
        seed=stream("verdict"),
    message:
        said("how far the run can be trusted")
    script:
        "../scripts/verdict.py"
