"""
Retrieval: from simulated images to a network, from observed images to a map of chlorophyll.

Needs   plots/{plot}/world/images.tif, crowns.geojson      or the user's
        plots/{plot}/scene/chm.tif, leaves.ply, summary.json
        plots/{plot}/images/coefficients.nc, semiless.nc
Makes   plots/{plot}/retrieval/canopy.tif                  pixels that see the canopy
        plots/{plot}/retrieval/observed_{mask}.tif         means of observed pixels by cell
        plots/{plot}/retrieval/pixels.csv                  spectra of sunlit and shaded pixels
        plots/{plot}/retrieval/training_{model}_{mask}.parquet
        plots/{plot}/retrieval/network_{model}_{mask}_{seed}.npz, history_....csv
        plots/{plot}/retrieval/map_{model}_{mask}.tif      chlorophyll with its interval
        plots/{plot}/retrieval/accuracy_{model}_{mask}.csv, trees_{model}_{mask}.csv
        chlorophyll/accuracy.csv, chlorophyll/map.tif      of all; map of the first plot
        chlorophyll/{plot}_*.png                           figures
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
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        **SELECTION,
        pixel_m=CHLOROPHYLL.images.pixel_m,
    message:
        "{settings.experiment}: average the observed images of {wildcards.plot}"
    script:
        "../scripts/observed_cells.py"


rule training_set:
    input:
        unpack(simulation),
        canopy=plot_file("retrieval/canopy.tif"),
        summary=plot_file("scene/summary.json"),
        code=code("training_set"),
    output:
        sunlit=plot_file("retrieval/training_{model}_sunlit.parquet"),
        all=plot_file("retrieval/training_{model}_all.parquet"),
    log:
        logs("training_set_{plot}_{model}"),
    benchmark:
        benchmarks("training_set_{plot}_{model}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=4000,
    params:
        leaves_and_soils=LEAVES_AND_SOILS,
        light=simulated_light,
        selection=SELECTION,
        max_entries=RETRIEVAL.max_entries,
        sail={
            "leaf_angle_deg": RETRIEVAL.leaf_angle_deg,
            "hot_spot": RETRIEVAL.hot_spot,
        },
        model="{model}",
        seed=lambda wildcards: stream("combinations", wildcards.plot),
    message:
        "{settings.experiment}: training set of {wildcards.plot} by {wildcards.model}"
    script:
        "../scripts/training_set.py"


rule network:
    input:
        training=plot_file("retrieval/training_{model}_{mask}.parquet"),
        code=code("network"),
    output:
        network=plot_file("retrieval/network_{model}_{mask}_{seed}.npz"),
        history=plot_file("retrieval/history_{model}_{mask}_{seed}.csv"),
    log:
        logs("network_{plot}_{model}_{mask}_{seed}"),
    benchmark:
        benchmarks("network_{plot}_{model}_{mask}_{seed}")
    wildcard_constraints:
        seed="[0-9]+",
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        seed="{seed}",
        split=SPLIT,
        split_seed=split_seed,
        network=NETWORK,
        range_ug_cm2=RETRIEVAL.chlorophyll_ug_cm2[:2],
    message:
        "{settings.experiment}: network {wildcards.seed} of {wildcards.plot}, {wildcards.model}, {wildcards.mask} pixels"
    script:
        "../scripts/network.py"


rule lcc_map:
    input:
        training=plot_file("retrieval/training_{model}_{mask}.parquet"),
        networks=networks_of,
        observed=plot_file("retrieval/observed_{mask}.tif"),
        code=code("lcc_map"),
    output:
        map=plot_file("retrieval/map_{model}_{mask}.tif"),
        interval=plot_file("retrieval/interval_{model}_{mask}.json"),
    log:
        logs("lcc_map_{plot}_{model}_{mask}"),
    benchmark:
        benchmarks("lcc_map_{plot}_{model}_{mask}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        seeds=RETRIEVAL.seeds,
        split=SPLIT,
        split_seed=split_seed,
        level=RETRIEVAL.interval_level,
        range_quantile=RETRIEVAL.range_quantile,
    message:
        "{settings.experiment}: chlorophyll of {wildcards.plot} by {wildcards.model}, {wildcards.mask} pixels"
    script:
        "../scripts/lcc_map.py"


rule accuracy:
    input:
        training=plot_file("retrieval/training_{model}_{mask}.parquet"),
        networks=networks_of,
        map=plot_file("retrieval/map_{model}_{mask}.tif"),
        interval=plot_file("retrieval/interval_{model}_{mask}.json"),
        crowns=plot_crowns,
        code=code("accuracy"),
    output:
        accuracy=plot_file("retrieval/accuracy_{model}_{mask}.csv"),
        trees=plot_file("retrieval/trees_{model}_{mask}.csv"),
        tests=plot_file("retrieval/tests_{model}_{mask}.parquet"),
    log:
        logs("accuracy_{plot}_{model}_{mask}"),
    benchmark:
        benchmarks("accuracy_{plot}_{model}_{mask}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        plot="{plot}",
        model="{model}",
        mask="{mask}",
        seeds=RETRIEVAL.seeds,
        split=SPLIT,
        split_seed=split_seed,
    message:
        "{settings.experiment}: accuracy in {wildcards.plot} of {wildcards.model}, {wildcards.mask} pixels"
    script:
        "../scripts/accuracy.py"


rule accuracy_table:
    input:
        accuracy=retrieval_files("accuracy_{model}_{mask}.csv"),
        map=retrieval_files("map_{model}_{mask}.tif")[0],
        code=code("accuracy_table"),
    output:
        accuracy=results("chlorophyll/accuracy.csv"),
        map=results("chlorophyll/map.tif"),
    log:
        logs("accuracy_table"),
    benchmark:
        benchmarks("accuracy_table")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=500,
    message:
        "{settings.experiment}: accuracy of all models"
    script:
        "../scripts/accuracy_table.py"


rule chlorophyll_figures:
    input:
        accuracy=of_plot("accuracy_{model}_{mask}.csv"),
        trees=of_plot("trees_{model}_{mask}.csv"),
        tests=of_plot("tests_{model}_{mask}.parquet"),
        training=of_plot("training_{model}_{mask}.parquet"),
        histories=histories_of,
        pixels=plot_file("retrieval/pixels.csv"),
        canopy=plot_file("retrieval/canopy.tif"),
        map=plot_file(f"retrieval/map_{TAUGHT[0][0]}_{TAUGHT[0][1]}.tif"),
        crowns=plot_crowns,
        code=code("chlorophyll_figures"),
    output:
        simulated=results("chlorophyll/{plot}_simulated.png"),
        field=results("chlorophyll/{plot}_field.png"),
        spectra=results("chlorophyll/{plot}_spectra.png"),
        losses=results("chlorophyll/{plot}_losses.png"),
        map=results("chlorophyll/{plot}_map.png"),
    log:
        logs("chlorophyll_figures_{plot}"),
    benchmark:
        benchmarks("chlorophyll_figures_{plot}")
    conda:
        "../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        taught=TAUGHT,
    message:
        "{settings.experiment}: figures of {wildcards.plot}"
    script:
        "../scripts/chlorophyll_figures.py"
