"""dapple: from laser scans to the light under the tree."""

from snakemake.utils import min_version

min_version("9.0")


configfile: "config/config.yaml"


include: "rules/common.smk"
include: "rules/scan.smk"
include: "rules/cloud.smk"
include: "rules/structure.smk"
include: "rules/sky.smk"
include: "rules/light.smk"
include: "rules/advice.smk"
include: "rules/statistics.smk"
include: "rules/figures.smk"
include: "rules/survey_common.smk"
include: "rules/survey.smk"


rule all:
    default_target: True
    input:
        targets(),


include: "rules/chlorophyll_common.smk"
include: "rules/plots.smk"
include: "rules/crowns.smk"
include: "rules/images.smk"
include: "rules/retrieval.smk"
include: "rules/stability_common.smk"
include: "rules/stability.smk"
include: "rules/verdict.smk"
