"""
Figures and the page that tells the whole run.

Needs   structure/, light/, statistics/
Makes   figures/tree.png          the tree from the side and from above, with the sensors
        figures/series.png        measured and simulated PAR through the day
        figures/boxplot.png       correlation of every sensor by reconstruction
        figures/scatter.png       simulated against measured PAR
        figures/ground_map.png    PAR on the ground at four times
        report.html               one self-contained page
"""

# Figures of the page, in its order: the name of the caption, and where a plain run makes it.
FIGURES = {
    "figures/tree.png": ("tree", LIT),
    "figures/series.png": ("series", LIT),
    "figures/boxplot.png": ("boxplot", COMPARED),
    "figures/scatter.png": ("scatter", COMPARED),
    "figures/ground_map.png": ("ground_map", LIT),
    "figures/advice.png": ("advice", False),
    "tradeoff/chart.png": ("tradeoff", False),
}


rule tree_figure:
    input:
        leaves=leaf_meshes("polygons")[0],
        wood=results("structure/polygons/wood.ply"),
        sensors=results("sky/sensors.csv"),
        code=code("tree_figure"),
    output:
        figure=report(
            results("figures/tree.png"),
            caption="../docs/captions/tree.rst",
            category="Structure",
        ),
    log:
        logs("tree_figure"),
    benchmark:
        benchmarks("tree_figure")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    message:
        said("picture of the tree")
    script:
        "../scripts/tree_figure.py"


rule series_figure:
    input:
        light=[results(f"light/{name}.nc") for name in LIT],
        records=results("statistics/records.csv") if COMPARED else [],
        code=code("series_figure"),
    output:
        figure=report(
            results("figures/series.png"),
            caption="../docs/captions/series.rst",
            category="Light",
        ),
    log:
        logs("series_figure"),
    benchmark:
        benchmarks("series_figure")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        sensors=settings.figures.sensors,
        reconstructions=LIT,
        timezone=settings.site.timezone,
    message:
        said("PAR through the day")
    script:
        "../scripts/series_figure.py"


rule comparison_figures:
    input:
        records=results("statistics/records.csv"),
        overall=results("statistics/overall.csv"),
        per_sensor=results("statistics/per_sensor.csv"),
        code=code("comparison_figures"),
    output:
        boxplot=report(
            results("figures/boxplot.png"),
            caption="../docs/captions/boxplot.rst",
            category="Statistics",
        ),
        scatter=report(
            results("figures/scatter.png"),
            caption="../docs/captions/scatter.rst",
            category="Statistics",
        ),
    log:
        logs("comparison_figures"),
    benchmark:
        benchmarks("comparison_figures")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    message:
        said("correlation by reconstruction")
    script:
        "../scripts/comparison_figures.py"


rule ground_map_figure:
    input:
        map=results("light/ground_map.nc"),
        wood=results("structure/polygons/wood.ply"),
        code=code("ground_map_figure"),
    output:
        figure=report(
            results("figures/ground_map.png"),
            caption="../docs/captions/ground_map.rst",
            category="Light",
        ),
    log:
        logs("ground_map_figure"),
    benchmark:
        benchmarks("ground_map_figure")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=1000,
    message:
        said("PAR on the ground")
    script:
        "../scripts/ground_map_figure.py"


rule page:
    input:
        made=[path for path in targets() if not path.endswith("report.html")],
        captions=[caption(name) for name, _ in FIGURES.values()],
        code=code("page"),
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
        mem_mb=500,
    params:
        experiment=settings.experiment,
        figures=list(FIGURES),
    message:
        said("report.html")
    script:
        "../scripts/page.py"
