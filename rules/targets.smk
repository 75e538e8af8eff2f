"""
Targets: what a plain run of each study makes. No rules here.

Needs   the configuration
Makes   nothing
"""

PLOT_FIGURES = ("map", "field", "spectra", "simulated", "losses")


def light_targets():
    """Geometry, light, their comparison with records and with the per-timestep engine."""
    wanted = ["classes/scores.json"]
    wanted += [f"structure/{name}/summary.json" for name in settings.reconstructions]
    wanted += [f"structure/{name}/voxels.vox" for name in VOXELS]
    if "polygons" in settings.reconstructions and settings.source != "wood":
        wanted += ["structure/polygons/distance.json"]
    if LIT:
        wanted += [f"light/{name}.nc" for name in LIT]
    if CHECKED:
        wanted += ["statistics/agreement.csv"]
    if COMPARED:
        wanted += ["statistics/overall.csv", "statistics/per_sensor.csv"]
        wanted += ["statistics/mixed_model.csv"]
    wanted += [about["path"] for about in FIGURES.values() if about["is_usual"]]
    return [*wanted, "verdict.json"]


def survey_targets():
    """What designs see and miss, how that is corrected, and a plan."""
    return [
        "survey/shadowing.csv",
        "survey/regression.csv",
        "survey/profile.csv",
        "survey/plan.png",
    ]


def chlorophyll_targets():
    """Accuracy, speed, a map, and figures of every plot."""
    return [
        "chlorophyll/accuracy.csv",
        "chlorophyll/speed.csv",
        "chlorophyll/map.tif",
        *(
            f"chlorophyll/{plot}_{figure}.png"
            for plot in settings.chlorophyll.plots
            for figure in PLOT_FIGURES
        ),
        *(f"chlorophyll/{plot}_report.html" for plot in settings.chlorophyll.plots),
    ]


def stability_targets():
    """Where reconstructions fail, as tables and pictures."""
    return [
        "stability/points.csv",
        "stability/thresholds.csv",
        "stability/published.csv",
        "stability/map.png",
        "stability/curves.png",
        "stability/verdict.csv",
    ]


STUDY_TARGETS = {
    "light": light_targets,
    "survey": survey_targets,
    "chlorophyll": chlorophyll_targets,
    "stability": stability_targets,
}


def targets():
    """What a plain run makes."""
    wanted = STUDY_TARGETS[settings.study]()
    return [
        results(path) for path in ["config.yaml", *wanted, "runtime.csv", "report.html"]
    ]
