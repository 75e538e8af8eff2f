"""
Figures and the page that tells the whole run.

Needs   structure/, light/, statistics/
Makes   figures/tree.png          the tree from the side and from above, with the sensors
        figures/series.png        measured and simulated PAR through the day
        figures/boxplot.png       correlation of every sensor by reconstruction
        figures/scatter.png       simulated against measured PAR
        figures/ground_map.png    PAR on the ground at four times
        figures/*.pdf             the same figures as vectors, for print; so it is in other studies
        figures/advice.png        what refinements of the light change and cost
        tradeoff/chart.png        accuracy against speed
        report.html               one self-contained page
"""

# Figures of the page, in its order. Each has a module in scripts/dapple/figures/, whose
# of_run(inputs, options) reads the files that are named here and draws.
FIGURES = {
    "tree": {
        "path": "figures/tree.png",
        "drawn_by": "tree",
        "category": "Structure",
        "caption": "The reconstructed tree from the side and from above. Green: leaf polygons; "
        "brown: wood polygons; points: PAR sensors.",
        "inputs": {
            "leaves": leaf_meshes("polygons")[0],
            "wood": results("structure/polygons/wood.ply"),
            "sensors": results("sky/sensors.csv"),
            "ground": GROUND,
        },
        "options": {"ground_z_m": GROUND_Z_M},
        "is_usual": bool(LIT),
    },
    "series": {
        "path": "figures/series.png",
        "drawn_by": "daily_courses",
        "category": "Light",
        "caption": "Photosynthetically active radiation through the day: measured (black) and "
        "simulated with each reconstruction (lines; band: where 90 % of records are expected "
        "under the first), at sensors from the darkest to the brightest of those that are ever shaded.",
        "inputs": {
            "light": [results(f"light/{name}.nc") for name in LIT],
            "records": results("statistics/records.csv") if COMPARED else [],
        },
        "options": {
            "sensors": settings.figures.sensors,
            "reconstructions": LIT,
            "timezone": settings.site.timezone,
        },
        "is_usual": bool(LIT),
    },
    "boxplot": {
        "path": "figures/boxplot.png",
        "drawn_by": "boxplot",
        "category": "Statistics",
        "caption": "Pearson's r of each sensor's series, by reconstruction.",
        "inputs": {
            "per_sensor": results("statistics/per_sensor.csv"),
            "overall": results("statistics/overall.csv"),
        },
        "is_usual": bool(COMPARED),
    },
    "scatter": {
        "path": "figures/scatter.png",
        "drawn_by": "scatter",
        "category": "Statistics",
        "caption": "Simulated against measured PAR, all sensors and times that no fit has seen; "
        "the line is 1:1.",
        "inputs": {
            "records": results("statistics/records.csv"),
            "overall": results("statistics/overall.csv"),
        },
        "is_usual": bool(COMPARED),
    },
    "ground_map": {
        "path": "figures/ground_map.png",
        "drawn_by": "ground_map",
        "category": "Light",
        "caption": "PAR on the ground around the stem at four times, one placement of the leaves.",
        "inputs": {
            "map": results("light/ground_map.nc"),
            "wood": results("structure/polygons/wood.ply"),
        },
        "options": {
            "times": settings.figures.map_times,
            "timezone": settings.time.timezone,
        },
        "is_usual": bool(LIT),
    },
    "advice": {
        "path": "figures/advice.png",
        "drawn_by": "effects_chart",
        "category": "Light",
        "caption": "What each refinement of the light changes (share of open-sky PAR) and costs, "
        "one at a time against the finest, on a pilot of sensors and times; in blue what the "
        "advised model leaves out.",
        "inputs": {"advice": results("advice.yaml")},
        "is_usual": False,
    },
    "tradeoff": {
        "path": "tradeoff/chart.png",
        "drawn_by": "pareto_chart",
        "category": "Light",
        "caption": "Accuracy against speed of every setting that was tried: error against the "
        "truth (or the finest polygons), and error of the rays, sky patches and scattering "
        "orders alone, over the wall time of this very run.",
        "inputs": {"points": results("tradeoff/points.csv")},
        "is_usual": False,
    },
}


# What stands below the figures of other studies.
CAPTIONS = {
    "survey/shadow_maps.png": "What the scans do not see, from above, in three slices of height.",
    "survey/shadowing.png": "Relative shadow against the number of laser beams; the shade is the "
    "range over virtual stands.",
    "survey/filled_profile.png": "Filled voxels by height: all, hit, and reached by some beam.",
    "survey/regression.png": "Contact frequency on the true share of filled voxels, by laser "
    "coverage.",
    "survey/profile.png": "Share of filled voxels by height: true, measured, corrected.",
    "survey/plan.png": "Relative shadow against the number of scans: planner, designs, chance.",
    "stability/map.png": "Median r by trouble (rows) and level (columns, harmless on the left); a "
    "cross marks failure.",
    "stability/curves.png": "r over the levels of each trouble; shades span the virtual worlds.",
}


for figure, about in FIGURES.items():

    rule:
        name:
            f"{figure}_figure"
        input:
            **about["inputs"],
            code=code("figure")
            + code(f"dapple/figures/{about['drawn_by']}")
            + [beside_code(f"figures/{about['drawn_by']}.py")],
        output:
            figure=report(
                results(about["path"]),
                caption="../docs/captions/figure.rst",
                category=about["category"],
            ),
            vector=vectors(about["path"]),
        log:
            logs(f"{figure}_figure"),
        benchmark:
            benchmarks(f"{figure}_figure")
        conda:
            "../envs/dapple.yaml"
        threads: 1
        resources:
            mem_mb=memory(2000),
        params:
            drawn_by=about["drawn_by"],
            options=about.get("options", {}),
            caption=about["caption"],
        message:
            said(f"figure {figure}")
        script:
            "../scripts/figure.py"


rule page:
    input:
        made=[path for path in targets() if not path.endswith("report.html")],
        code=code("page") + REPORT_TEMPLATES,
    output:
        page=results("report.html"),
    log:
        logs("page"),
    benchmark:
        benchmarks("page")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        experiment=settings.experiment,
        captions={about["path"]: about["caption"] for about in FIGURES.values()}
        | CAPTIONS,
    message:
        said("report.html")
    script:
        "../scripts/page.py"
