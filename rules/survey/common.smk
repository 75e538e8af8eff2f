"""
Settings of the survey, and what its rules share. No rules here.

Needs   the configuration
Makes   nothing
"""

SURVEY = settings.survey
REPLICATES = range(1, SURVEY.replicates + 1)
STANDS = [(stand, replicate) for stand in SURVEY.stands for replicate in REPLICATES]
SCANS = [(*stand, design) for stand in STANDS for design in SURVEY.designs]
SCANNER = {
    key: getattr(SURVEY, key)
    for key in (
        "zenith_step_deg",
        "azimuth_steps_deg",
        "beam_divergence_mrad",
        "exit_aperture_m",
        "sub_rays",
        "reflectance",
        "min_energy",
        "pulse_m",
        "max_returns",
    )
}

PLANNED_FROM = (
    {"canopy": data(SURVEY.canopy)}
    if SURVEY.canopy
    else {
        "voxels": results(f"structure/voxels_{SURVEY.cell_size_m}/voxels.nc"),
        "shots": results("scan/shots.parquet"),
    }
)

if settings.study == "survey":
    from dapple.survey.checks import check

    try:
        check(
            stands=SURVEY.stands,
            leaf_area_index=SURVEY.leaf_area_index,
            volume_m=SURVEY.volume_m,
            voxel_size_m=SURVEY.voxel_size_m,
            cell_size_m=SURVEY.cell_size_m,
            design_names=SURVEY.designs,
            positions_m=SURVEY.positions_m,
            height_m=SURVEY.height_m,
            density_step_deg=SURVEY.density_step_deg,
            scanner=SCANNER,
        )
    except InputError as error:
        sys.exit(f"dapple: {error}")


def grown(stand, replicate):
    """What a stand is grown from."""
    leaf_area_index = dict(zip(SURVEY.stands, SURVEY.leaf_area_index))
    return {
        "positions_m": SURVEY.trees_m,
        "size_m": SURVEY.volume_m,
        "leaf_area_index": leaf_area_index[stand],
        "n_grown": SURVEY.grown,
        "seed": stream("survey", replicate),
    }


def stand_settings(wildcards):
    """What the stand of a job is grown from."""
    return grown(wildcards.stand, wildcards.replicate)


def survey_files(name, runs):
    """One file of every run (stand, replicate and, for scans, design)."""
    return [
        results(f"survey/{run[0]}_{run[1]}/{name.format(*run[2:])}.nc") for run in runs
    ]
