"""Relative shadow of every design and density, profiles of filled voxels and maps of shadow."""

import numpy as np
import pandas as pd

from dapple.formats import netcdf, tables
from dapple.formats.atomic import atomic
from dapple.progress import followed
from dapple.survey import shadow
from dapple.survey.voxel_status import attribute
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    rows, profiles, maps = [], [], {}
    truths = {}
    runs = list(zip(params.runs, snakemake.input.reach, strict=True))
    for (stand, seed, design), path in followed(runs, "designs in stands"):
        if (stand, seed) not in truths:
            at = params.truths.index((stand, seed))
            truth = netcdf.read(snakemake.input.truth[at])
            truths = {(stand, seed): (truth.leaf_area_m2 + truth.wood_area_m2).values > 0}
        filled, reach = truths[stand, seed], netcdf.read(path)
        n_beams = np.atleast_1d(reach.attrs["n_beams"])
        for bit, n in enumerate(n_beams):
            found = attribute(reach.hit.values, reach.passed.values, bit)
            shares = shadow.relative_shadow(found, filled)
            row = {"stand": stand, "design": design, "n_beams": int(n)}
            rows.append(row | {"rs": shares.pop("rs"), "seed": seed} | shares)
            profile = pd.DataFrame(shadow.filled_profile(found, filled))
            height = (np.arange(len(profile)) + 0.5) * reach.attrs["voxel_size_m"]
            profiles.append(
                profile.assign(
                    stand=stand, design=design, n_beams=int(n), seed=seed, height_m=height
                )
            )
        if seed == 1:
            found = attribute(reach.hit.values, reach.passed.values, int(np.argmax(n_beams)))
            third = filled.shape[2] // 3
            for level in range(3):
                maps[f"{stand}/{design}/{level}"] = shadow.shadow_map(
                    found, filled, params.per_edge, level * third, (level + 1) * third
                )
    table = pd.DataFrame(rows)
    profile = pd.concat(profiles)[
        ["stand", "design", "n_beams", "seed", "height_m", "true", "hit", "reached"]
    ]
    for path, frame in ((snakemake.output.shadowing, table), (snakemake.output.profile, profile)):
        tables.write(path, frame)
    with atomic(snakemake.output.maps) as partial:
        np.savez_compressed(partial, **maps)


if __name__ == "__main__":
    run(main, snakemake)
