"""Rebuild leaves as discs on local surfaces, opened where shots passed."""

from dapple import findings, steps
from dapple.formats import clouds, json, meshes, shots
from dapple.structure import summary, surfels
from dapple.workflow import options, run


def main(snakemake):
    inputs, outputs = snakemake.input, snakemake.output
    cloud = clouds.read(inputs.cloud)
    fired = shots.iterate(inputs.shots) if inputs.shots else None
    leaves, facts = steps.surfels(cloud, fired, **options(snakemake.params))
    findings.say(surfels.doubts(facts, inputs.cloud))
    print(f"{leaves.n_elements:,} discs, {leaves.area_m2:.2f} m²")
    meshes.write_ply(outputs.leaves, leaves, cloud.origin_m)
    truth = json.read(inputs.truth) if inputs.truth else None
    json.write(
        outputs.summary, summary.of_meshes(leaves, meshes.read_ply(inputs.wood), truth) | facts
    )


if __name__ == "__main__":
    run(main, snakemake)
