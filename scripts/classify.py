"""Tell leaf from wood; score against the truth where it is known."""

from dapple import findings
from dapple.cloud.classify import classify, doubts
from dapple.formats import clouds, json
from dapple.workflow import options, run


def main(snakemake):
    path = snakemake.input.cloud
    settings = options(snakemake.params) | {"model": snakemake.input.model or None}
    cloud, facts = classify(clouds.read(path), where=path, **settings)
    findings.say(doubts(facts, settings["threshold_db"], path))
    print(f"{len(cloud):,} points by {facts['method']}: {facts['leaf_share']:.1%} of them leaf")
    clouds.write(snakemake.output.cloud, cloud)
    json.write(snakemake.output.scores, facts)


if __name__ == "__main__":
    run(main, snakemake)
