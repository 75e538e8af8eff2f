"""dapple: from laser scans to the light under the tree."""

from snakemake.utils import min_version

min_version("9.0")


configfile: f"{workflow.current_basedir}/config/config.yaml"


include: "rules/common.smk"
include: "rules/targets.smk"
include: "rules/download.smk"
include: "rules/check.smk"
include: "rules/scan.smk"
include: "rules/cloud.smk"
include: "rules/structure.smk"
include: "rules/rescan.smk"
include: "rules/registration.smk"
include: "rules/sky.smk"
include: "rules/light.smk"
include: "rules/exchange.smk"
include: "rules/advice.smk"
include: "rules/figures.smk"
include: "rules/statistics.smk"
include: "rules/verdict.smk"
include: "rules/survey/common.smk"
include: "rules/survey/scans.smk"
include: "rules/survey/shadowing.smk"
include: "rules/survey/plan.smk"
include: "rules/chlorophyll/common.smk"
include: "rules/chlorophyll/input.smk"
include: "rules/chlorophyll/plots.smk"
include: "rules/chlorophyll/crowns.smk"
include: "rules/chlorophyll/images.smk"
include: "rules/chlorophyll/retrieval.smk"
include: "rules/stability/common.smk"
include: "rules/stability/runs.smk"
include: "rules/stability/map.smk"
include: "rules/stability/records.smk"
include: "rules/provenance.smk"
include: "rules/estimate.smk"


rule all:
    default_target: True
    input:
        targets(),


onstart:
    if workflow.is_main_process and (said_first := forewarning(workflow.dag)):
        logger.info(said_first)
