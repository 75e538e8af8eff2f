"""Grow a world, scan it and run all reconstructions undisturbed: what batches share."""

from dapple import engine
from dapple.formats import clouds, json, meshes, shots, tables
from dapple.stability import outcome
from dapple.stability.chain import Chain
from dapple.stability.stressors import UNDISTURBED, Level, Stressor
from dapple.stability.world import Setup
from dapple.workflow import run


def main(snakemake):
    params, outputs = snakemake.params, snakemake.output
    engine.use_threads(snakemake.threads)
    chain = Chain(Setup(**params.setup), params.seed)
    level = Level(0.0, "undisturbed", {})
    nothing = Stressor("undisturbed", "undisturbed", (level,), 0.0)
    rows = outcome.rows(
        chain, nothing, level, int(snakemake.wildcards.world), params.reconstructions
    )
    plant = chain.tree(UNDISTURBED)
    meshes.write_ply(outputs.leaves, plant["leaf"])
    meshes.write_ply(outputs.wood, plant["wood"])
    shots.write(outputs.shots, chain.shots(UNDISTURBED))
    clouds.write(outputs.cloud, chain.clean(UNDISTURBED))
    json.write(outputs.seconds, {step: chain.took_s(step) for step in ("tree", "shots", "clean")})
    tables.write(outputs.undisturbed, outcome.table(rows))


if __name__ == "__main__":
    run(main, snakemake)
