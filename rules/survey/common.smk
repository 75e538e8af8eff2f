"""
Settings of the survey, and what its rules share. No rules here.

Needs   the configuration
Makes   nothing
"""

SURVEY = settings.survey
REPLICATES = range(1, SURVEY.replicates + 1)
STANDS = [(stand, replicate) for stand in SURVEY.stands for replicate in REPLICATES]
SCANS = [(*stand, design) for stand in STANDS for design in SURVEY.designs]

PLANNED_FROM = (
    {"canopy": data(SURVEY.canopy)}
    if SURVEY.canopy
    else {
        "voxels": results(f"structure/voxels_{SURVEY.cell_size_m}/voxels.nc"),
        "shots": results("scan/shots.parquet"),
    }
)


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
