"""Run all reconstructions under every level of one stressor in one world."""

import pandas as pd

from dapple import engine
from dapple.formats import clouds, json, meshes, shots, tables
from dapple.progress import followed
from dapple.stability import outcome, stressors
from dapple.stability.chain import Chain
from dapple.stability.stressors import UNDISTURBED
from dapple.stability.world import Setup
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    engine.use_threads(snakemake.threads)
    world = int(snakemake.wildcards.world)
    stressor = stressors.find(snakemake.wildcards.stressor)
    chain = Chain(Setup(**params.setup), params.seed)
    seconds = json.read(inputs.seconds)
    ready = {
        "tree": {"leaf": meshes.read_ply(inputs.leaves), "wood": meshes.read_ply(inputs.wood)},
        "shots": shots.read(inputs.shots),
        "clean": clouds.read(inputs.cloud),
    }
    for step, value in ready.items():
        chain.give(step, UNDISTURBED, value, seconds[step])
    parts = []
    for level in followed(stressor.chosen(params.levels), f"levels of {stressor.name}"):
        if level.changes:
            rows = outcome.rows(chain, stressor, level, world, params.reconstructions)
            parts.append(outcome.table(rows))
        else:
            undisturbed = tables.read(inputs.undisturbed)
            parts.append(
                undisturbed.assign(stressor=stressor.name, level=level.value, label=level.label)
            )
        print(f"{stressor.name} {level.label}", flush=True)
    tables.write(snakemake.output.batch, pd.concat(parts, ignore_index=True))


if __name__ == "__main__":
    run(main, snakemake)
