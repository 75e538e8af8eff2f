"""
Structure: from classified points and shots to geometry that light can meet.

Needs   classes/cloud.laz                 points with `Classification`
        scan/shots.parquet                every shot with its returns, misses included
Makes   structure/polygons/*.ply, *.obj   one polygon per 5 cm voxel and class
        structure/polygons/distance.json  how far cleaned points lie from the polygons
        structure/surfels/                leaves as discs on local surfaces, opened by the shots
        structure/voxels_{size}/          plant area density: voxels.nc, voxels.vox
"""

if settings.source != "wood":

    rule polygons:
        input:
            cloud=results("classes/cloud.laz"),
            voxels=(
                results(f"structure/voxels_{min(settings.voxels.sizes_m)}/voxels.nc")
                if settings.corrections.occlusion
                else []
            ),
            truth=(
                results("structure/truth/summary.json")
                if settings.source == "virtual"
                else []
            ),
            code=code(
                "polygons",
                unused=(
                    [] if settings.corrections.occlusion else ["structure.occlusion"]
                ),
            ),
        output:
            leaves=results("structure/polygons/leaves_0.ply"),
            wood=results("structure/polygons/wood.ply"),
            summary=results("structure/polygons/summary.json"),
        log:
            logs("polygons"),
        benchmark:
            benchmarks("polygons")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(2000),
        params:
            **dict(settings.polygons),
            correction=(
                {"fill_range_m": settings.corrections.fill_range_m}
                if settings.corrections.occlusion
                else None
            ),
            bracket=True,
            seed=stream("polygons"),
        message:
            said("polygons, edge of the voxels [m]: {params.voxel_size_m}")
        script:
            "../scripts/polygons.py"

    rule surfels:
        input:
            cloud=results("classes/cloud.laz"),
            shots=results("scan/shots.parquet") if settings.has_shots else [],
            wood=results("structure/polygons/wood.ply"),
            truth=(
                results("structure/truth/summary.json")
                if settings.source == "virtual"
                else []
            ),
            code=code("surfels"),
        output:
            leaves=results("structure/surfels/leaves_0.ply"),
            summary=results("structure/surfels/summary.json"),
        log:
            logs("surfels"),
        benchmark:
            benchmarks("surfels")
        conda:
            "../envs/dapple.yaml"
        threads: 2
        resources:
            mem_mb=memory(4000),
        params:
            **SURFELS,
            seed=stream("surfels"),
        message:
            said("leaves as discs on local surfaces")
        script:
            "../scripts/surfels.py"

    rule cloud_to_mesh:
        input:
            cloud=results("clean/cloud.laz"),
            leaves=results("structure/polygons/leaves_0.ply"),
            wood=results("structure/polygons/wood.ply"),
            code=code("cloud_to_mesh"),
        output:
            distance=results("structure/polygons/distance.json"),
        log:
            logs("cloud_to_mesh"),
        benchmark:
            benchmarks("cloud_to_mesh")
        conda:
            "../envs/cloud.yaml"
        threads: 1
        resources:
            mem_mb=memory(4000),
        params:
            cloudcompare=settings.tools.cloudcompare,
            max_points=settings.clean.distance_points,
            seed=stream("cloud_to_mesh"),
        message:
            said("distance of the cleaned points from the polygons")
        script:
            "../scripts/cloud_to_mesh.py"


rule export_obj:
    input:
        leaves=results("structure/{meshed}/leaves_0.ply"),
        wood=lambda wildcards: wood_of(wildcards.meshed),
        code=code("export_obj"),
    output:
        leaves=results("structure/{meshed}/leaves.{axes}.obj"),
        wood=results("structure/{meshed}/wood.{axes}.obj"),
    log:
        logs("export_obj_{meshed}_{axes}"),
    benchmark:
        benchmarks("export_obj_{meshed}_{axes}")
    wildcard_constraints:
        axes="less|dart",
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    message:
        said("{wildcards.meshed} in the axes of {wildcards.axes}")
    script:
        "../scripts/export_obj.py"


rule voxels:
    input:
        shots=results("scan/shots.parquet"),
        classes=results("classes/cloud.laz"),
        code=code(
            "voxels",
            unused=(
                []
                if settings.corrections.clumping
                else ["structure.subvoxel_clumping"]
            ),
        ),
    output:
        voxels=results("structure/voxels_{size}/voxels.nc"),
        amapvox=results("structure/voxels_{size}/voxels.vox"),
    log:
        logs("voxels_{size}"),
    benchmark:
        benchmarks("voxels_{size}")
    conda:
        "../envs/dapple.yaml"
    threads: 2
    resources:
        mem_mb=memory(2000),
    params:
        **settings.voxels.model_dump(exclude={"sizes_m"}),
        correction=clumping_correction,
        majority_voxel_m=settings.classify.majority_voxel_m,
    message:
        said("plant area density in {wildcards.size} m voxels")
    script:
        "../scripts/voxels.py"


rule export:
    input:
        expand(
            results("structure/{meshed}/{kind}.{axes}.obj"),
            meshed=[
                name
                for name in settings.reconstructions
                if name in ("polygons", "surfels", "truth")
            ],
            kind=["leaves", "wood"],
            axes=["less", "dart"],
        ),
        expand(results("export/{name}/scene.glb"), name=LIT),
        expand(
            results("export/{name}/exchange"),
            name=[name for name in LIT if not name.startswith("voxels_")],
        ),
    message:
        said("OBJ for LESS 2 and DART, scenes for LESS 3, as glTF and to be exchanged")


rule voxels_summary:
    input:
        voxels=results("structure/voxels_{size}/voxels.nc"),
        wood=results("structure/polygons/wood.ply") if LIT else [],
        truth=(
            results("structure/truth/summary.json")
            if settings.source == "virtual"
            else []
        ),
        code=code("voxels_summary"),
    output:
        summary=results("structure/voxels_{size}/summary.json"),
        plant_area=results("structure/voxels_{size}/plant_area.csv"),
        intervals=results("structure/voxels_{size}/plant_area.nc"),
    log:
        logs("summary_voxels_{size}"),
    benchmark:
        benchmarks("summary_voxels_{size}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        element_area_m2=settings.voxels.single_leaf_area_m2
        or settings.polygons.leaf_size_m**2,
        fill_range_m=settings.corrections.fill_range_m,
    message:
        said("areas in {wildcards.size} m voxels, and how sure they are")
    script:
        "../scripts/voxels_summary.py"
