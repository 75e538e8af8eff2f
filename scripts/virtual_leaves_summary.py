"""Areas of real wood and of the virtual leaves placed along it."""

import numpy as np

from dapple.formats import json, meshes
from dapple.structure.summary import of_meshes
from dapple.workflow import run


def main(snakemake):
    wood = meshes.read_ply(snakemake.input.wood)
    placements = [meshes.read_ply(path) for path in snakemake.input.leaves]
    facts = of_meshes(placements[0], wood)
    facts["placements"] = len(placements)
    facts["leaf_area_m2"] = float(np.mean([leaves.area_m2 for leaves in placements]))
    json.write(snakemake.output.summary, facts)


if __name__ == "__main__":
    run(main, snakemake)
