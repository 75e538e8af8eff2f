"""
Rescan: shots of a scan position predicted from what the other positions show; made on demand.

Needs   scan/shots.parquet, classes/cloud.laz
Makes   structure/{reconstruction}/rescan.csv   share of shots that are predicted right, share that
                                                passes and bias of ranges, by part of the crown
"""

# What other reconstructions are made by.
MADE_BY = {
    "polygons": [],
    "surfels": ["structure.surfels"],
    "voxels": ["structure.voxels"],
}
RESCANNED = (
    settings.reconstructions if settings.has_shots and settings.source != "wood" else ()
)


if RESCANNED:

    rule rescan_shots:
        input:
            shots=results("scan/shots.parquet"),
            classes=results("classes/cloud.laz"),
            leaf=branch(
                lambda wildcards: wildcards.reconstruction == "truth",
                then=results("structure/truth/leaves_0.ply"),
            ),
            wood=branch(
                lambda wildcards: wildcards.reconstruction == "truth",
                then=results("structure/truth/wood.ply"),
            ),
            code=lambda wildcards: code(
                "rescan",
                unused=[
                    module
                    for kind, modules in MADE_BY.items()
                    if not wildcards.reconstruction.startswith(kind)
                    for module in modules
                ],
            ),
        output:
            table=results("structure/{reconstruction}/rescan.csv"),
        log:
            logs("rescan_{reconstruction}"),
        benchmark:
            benchmarks("rescan_{reconstruction}")
        conda:
            "../envs/stability.yaml"
        threads: 2
        resources:
            mem_mb=4000,
        params:
            **settings.rescan.model_dump(),
            max_deviation=settings.clean.max_deviation,
            exit_aperture_m=settings.surfels.beam_diameter_m,
            beam_divergence_mrad=settings.surfels.beam_divergence_mrad,
            polygons=settings.polygons.model_dump() | {"seed": stream("polygons")},
            surfels=SURFELS | {"seed": stream("surfels")},
            voxels=settings.voxels.model_dump(exclude={"sizes_m"}),
            points={
                "majority_voxel_m": settings.classify.majority_voxel_m,
                "max_deviation": settings.clean.max_deviation,
                "thin_voxel_m": settings.clean.thin_voxel_m,
            },
            seed=stream("rescan"),
        message:
            said("shots that {wildcards.reconstruction} predicts")
        script:
            "../scripts/rescan.py"


rule rescan:
    input:
        (
            expand(
                results("structure/{reconstruction}/rescan.csv"),
                reconstruction=RESCANNED,
            )
            if RESCANNED
            else without_shots
        ),
    message:
        said("shots of positions left out, predicted by every reconstruction")
