"""
Input: a user's images and crowns as the chain takes them, and the light of every plot.

Needs   the files of chlorophyll.user; nothing for a virtual plot
Makes   plots/user/input/images.tif        reflectance by band, in the cloud's coordinate system
        plots/user/input/crowns.geojson    outlines in that system, chlorophyll where it is known
        plots/user/input/images.json, crowns.json    what was found in the files
        plots/{plot}/light/sun.json, sky.json        sun, and share of skylight in every band
"""


rule own_images:
    input:
        lidar=own("lidar"),
        images=own("images"),
        code=code("own_images"),
    output:
        images=results("plots/user/input/images.tif"),
        facts=results("plots/user/input/images.json"),
    log:
        logs("own_images"),
    benchmark:
        benchmarks("own_images")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(6000),
    params:
        crs=CROWNS.crs,
        bands=BANDS,
        how=CHLOROPHYLL.user.model_dump(include={"scale", "nodata", "band_order"}),
    message:
        said("read your images")
    script:
        "../../scripts/own_images.py"


rule own_crowns:
    input:
        crowns=own("crowns"),
        images=results("plots/user/input/images.tif"),
        code=code("own_crowns"),
    output:
        crowns=results("plots/user/input/crowns.geojson"),
        facts=results("plots/user/input/crowns.json"),
    log:
        logs("own_crowns"),
    benchmark:
        benchmarks("own_crowns")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        tree_column=CHLOROPHYLL.user.crowns_tree_column,
        lcc_column=CHLOROPHYLL.user.crowns_lcc_column,
        layer=CHLOROPHYLL.user.crowns_layer,
    message:
        said("read your crowns")
    script:
        "../../scripts/own_crowns.py"


rule plot_light:
    input:
        images=lambda wildcards: (
            plot_images(wildcards) if wildcards.plot == "user" else []
        ),
        responses=RESPONSES,
        code=code("plot_light"),
    output:
        sun=SUN,
        sky=SKYLIGHT,
    log:
        logs("plot_light_{plot}"),
    benchmark:
        benchmarks("plot_light_{plot}")
    conda:
        "../../envs/dapple.yaml"
    threads: 1
    resources:
        mem_mb=memory(1000),
    params:
        stated=plot_light,
        bands=BANDS,
    message:
        said("sun and sky of the images of {wildcards.plot}")
    script:
        "../../scripts/plot_light.py"
