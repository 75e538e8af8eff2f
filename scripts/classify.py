"""Tell leaf from wood; score against the truth where it is known."""

from dapple.cloud.scores import scores

from dapple.cloud import classify
from dapple.formats import clouds, json
from dapple.workflow import run


def main(snakemake):
    cloud = clouds.read(snakemake.input.cloud)
    params = snakemake.params
    classified, facts = classify.classify(
        cloud,
        method=params.method,
        threshold_db=params.threshold_db,
        majority_voxel_m=params.majority_voxel_m,
    )
    if "TrueClass" in cloud.attributes:
        truth = cloud.attributes["TrueClass"]
        facts |= scores(classified.attributes["Classification"], truth)
    clouds.write(snakemake.output.cloud, classified)
    json.write(snakemake.output.scores, facts)


if __name__ == "__main__":
    from snakemake.script import snakemake

    run(main, snakemake)
