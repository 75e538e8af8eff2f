"""
Retrieval: from simulated images to a network, from observed images to a map of chlorophyll.

Needs   plots/{plot}/world/images.tif, crowns.geojson      or the user's
        plots/{plot}/scene/chm.tif, leaves.ply, wood.ply, summary.json
        plots/{plot}/images/coefficients.nc, semiless.nc
Makes   plots/{plot}/retrieval/canopy.tif                  pixels that see the canopy
        plots/{plot}/retrieval/observed_{mask}.tif         means of observed pixels by cell
        plots/{plot}/retrieval/pixels.csv                  spectra of sunlit and shaded pixels
        plots/{plot}/retrieval/training_{model}_{mask}.parquet
        plots/{plot}/retrieval/network_{model}_{mask}_{network}_{seed}.npz, history_....csv
        plots/{plot}/retrieval/map_{model}_{mask}_{network}.tif   chlorophyll with its interval
        plots/{plot}/retrieval/accuracy_{model}.csv, trees_{model}.csv
        chlorophyll/accuracy.csv, chlorophyll/map.tif      of all; map of the first plot
        chlorophyll/{plot}_*.png, {plot}_report.html       figures, and all of a plot on one page
"""


rule observed_cells:
    input:
        images=plot_images,
        heights=plot_file("scene/chm.tif"),
        code=code("observed_cells"),
    output:
        sunlit=plot_file("retrieval/observed_sunlit.tif"),
        all=plot_file("retrieval/observed_all.tif"),
        canopy=plot_file("retrieval/canopy.tif"),
        pixels=plot_file("retrieval/pixels.csv"),
    log:
        logs("observed_cells_{plot}"),
    benchmark:
        benchmarks("observed_cells_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        **SELECTION,
        bands=BANDS,
        pixel_m=CHLOROPHYLL.images.pixel_m,
    message:
        said("average the observed images of {wildcards.plot}")
    script:
        "../../scripts/observed_cells.py"


rule training_set:
    input:
        unpack(simulation),
        canopy=plot_file("retrieval/canopy.tif"),
        summary=plot_file("scene/summary.json"),
        sun=SUN,
        sky=SKYLIGHT,
        responses=RESPONSES,
        code=code("training_set"),
    output:
        sunlit=plot_file("retrieval/training_{model}_sunlit.parquet"),
        all=plot_file("retrieval/training_{model}_all.parquet"),
    log:
        logs("training_set_{plot}_{model}"),
    benchmark:
        benchmarks("training_set_{plot}_{model}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(4000),
    params:
        bands=BANDS,
        leaves_and_soils=LEAVES_AND_SOILS,
        bark=BARK,
        selection=SELECTION,
        max_entries=RETRIEVAL.max_entries,
        sail={
            "leaf_angle_deg": RETRIEVAL.leaf_angle_deg,
            "hot_spot": RETRIEVAL.hot_spot,
        },
        model="{model}",
        seed=lambda wildcards: stream("combinations", wildcards.plot),
    message:
        said("training set of {wildcards.plot} by {wildcards.model}")
    script:
        "../../scripts/training_set.py"


rule network:
    input:
        training=plot_file("retrieval/training_{model}_{mask}.parquet"),
        code=code("network"),
    output:
        networks=[
            plot_file(f"retrieval/network_{{model}}_{{mask}}_{{network}}_{seed}.npz")
            for seed in RETRIEVAL.seeds
        ],
        history=plot_file("retrieval/history_{model}_{mask}_{network}.csv"),
    log:
        logs("network_{plot}_{model}_{mask}_{network}"),
    benchmark:
        benchmarks("network_{plot}_{model}_{mask}_{network}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        bands=CAMERA.names,
        seeds=RETRIEVAL.seeds,
        split=SPLIT,
        split_seed=split_seed,
        errors=lambda wildcards: ERRORS if wildcards.network == "robust" else None,
        options=NETWORK,
        range_ug_cm2=RETRIEVAL.chlorophyll_ug_cm2[:2],
    message:
        said(
            "{wildcards.network} networks of {wildcards.plot}, {wildcards.model}, {wildcards.mask} pixels"
        )
    script:
        "../../scripts/network.py"


rule lcc_map:
    input:
        training=of_model("training_{model}_{mask}.parquet"),
        networks=networks_of_model,
        observed=of_model("observed_{mask}.tif"),
        code=code("lcc_map"),
    output:
        maps=made_of_model("map_{model}_{mask}_{network}.tif"),
        intervals=made_of_model("interval_{model}_{mask}_{network}.json"),
    log:
        logs("lcc_map_{plot}_{model}"),
    benchmark:
        benchmarks("lcc_map_{plot}_{model}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        taught=lambda wildcards: taught_by(wildcards.model),
        bands=CAMERA.names,
        seeds=RETRIEVAL.seeds,
        split=SPLIT,
        split_seed=split_seed,
        errors=ERRORS,
        level=RETRIEVAL.interval_level,
        range_quantile=RETRIEVAL.range_quantile,
    message:
        said("chlorophyll of {wildcards.plot} by {wildcards.model}")
    script:
        "../../scripts/lcc_map.py"


rule accuracy:
    input:
        training=of_model("training_{model}_{mask}.parquet"),
        networks=networks_of_model,
        maps=of_model("map_{model}_{mask}_{network}.tif"),
        intervals=of_model("interval_{model}_{mask}_{network}.json"),
        crowns=plot_crowns,
        code=code("accuracy"),
    output:
        accuracy=plot_file("retrieval/accuracy_{model}.csv"),
        trees=plot_file("retrieval/trees_{model}.csv"),
        tests=plot_file("retrieval/tests_{model}.parquet"),
    log:
        logs("accuracy_{plot}_{model}"),
    benchmark:
        benchmarks("accuracy_{plot}_{model}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(2000),
    params:
        plot="{plot}",
        taught=lambda wildcards: taught_by(wildcards.model),
        bands=CAMERA.names,
        seeds=RETRIEVAL.seeds,
        split=SPLIT,
        split_seed=split_seed,
        errors=ERRORS,
    message:
        said("accuracy of {wildcards.model} in {wildcards.plot}")
    script:
        "../../scripts/accuracy.py"


rule accuracy_table:
    input:
        accuracy=[
            results(f"plots/{plot}/retrieval/accuracy_{model}.csv")
            for plot in CHLOROPHYLL.plots
            for model in RETRIEVAL.models
        ],
        map=retrieval_files("map_{model}_{mask}_{network}.tif")[0],
        code=code("accuracy_table"),
    output:
        accuracy=results("chlorophyll/accuracy.csv"),
        map=results("chlorophyll/map.tif"),
    log:
        logs("accuracy_table"),
    benchmark:
        benchmarks("accuracy_table")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    message:
        said("accuracy of all models")
    script:
        "../../scripts/accuracy_table.py"


rule chlorophyll_figures:
    input:
        accuracy=[
            plot_file(f"retrieval/accuracy_{model}.csv") for model in RETRIEVAL.models
        ],
        trees=[plot_file(f"retrieval/trees_{model}.csv") for model in RETRIEVAL.models],
        tests=[
            plot_file(f"retrieval/tests_{model}.parquet") for model in RETRIEVAL.models
        ],
        training=of_plot("training_{model}_{mask}.parquet"),
        histories=of_plot("history_{model}_{mask}_{network}.csv"),
        pixels=plot_file("retrieval/pixels.csv"),
        canopy=plot_file("retrieval/canopy.tif"),
        map=plot_file(
            "retrieval/map_{model}_{mask}_{network}.tif".format(
                plot="{plot}", **TAUGHT[0]
            )
        ),
        crowns=plot_crowns,
        code=code("chlorophyll_figures"),
    output:
        simulated=results("chlorophyll/{plot}_simulated.png"),
        field=results("chlorophyll/{plot}_field.png"),
        spectra=results("chlorophyll/{plot}_spectra.png"),
        losses=results("chlorophyll/{plot}_losses.png"),
        map=results("chlorophyll/{plot}_map.png"),
        vectors=vectors(*(f"chlorophyll/{{plot}}_{name}.png" for name in PLOT_FIGURES)),
    log:
        logs("chlorophyll_figures_{plot}"),
    benchmark:
        benchmarks("chlorophyll_figures_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1500),
    params:
        taught=TAUGHT,
        bands=BANDS,
    message:
        said("figures of {wildcards.plot}")
    script:
        "../../scripts/chlorophyll_figures.py"


rule plot_page:
    input:
        found=plot_input_facts,
        sun=SUN,
        sky=SKYLIGHT,
        summary=plot_file("scene/summary.json"),
        maps=of_plot("map_{model}_{mask}_{network}.tif"),
        intervals=of_plot("interval_{model}_{mask}_{network}.json"),
        accuracy=[
            plot_file(f"retrieval/accuracy_{model}.csv") for model in RETRIEVAL.models
        ],
        trees=[plot_file(f"retrieval/trees_{model}.csv") for model in RETRIEVAL.models],
        figures=[results(f"chlorophyll/{{plot}}_{name}.png") for name in PLOT_FIGURES],
        code=code("plot_page") + REPORT_TEMPLATES,
    output:
        page=results("chlorophyll/{plot}_report.html"),
    log:
        logs("plot_page_{plot}"),
    benchmark:
        benchmarks("plot_page_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(500),
    params:
        plot="{plot}",
        bands=CAMERA.names,
        taught=TAUGHT,
        range_quantile=RETRIEVAL.range_quantile,
    message:
        said("a page about {wildcards.plot}")
    script:
        "../../scripts/plot_page.py"
