"""Contact frequency by laser coverage, correction factors, and likelihood beside them."""

import numpy as np
import pandas as pd

from dapple.formats import netcdf, tables, voxel_grids
from dapple.survey import compare, correction
from dapple.survey.voxel_status import attribute
from dapple.virtual.stand_species import SPECIES
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    cells, estimates = {}, []
    for (stand, seed, design), reach_path, cells_path in zip(
        params.runs, snakemake.input.reach, snakemake.input.cells, strict=True
    ):
        truth = netcdf.read(snakemake.input.truth[params.truths.index((stand, seed))])
        reach, density = netcdf.read(reach_path), voxel_grids.read(cells_path)
        bit = int(np.argmax(reach.attrs["n_beams"]))
        cells[stand, seed, design] = correction.cells_of(
            attribute(reach.hit.values, reach.passed.values, bit),
            truth.leaf_area_m2.values,
            truth.wood_area_m2.values,
            density.mean_zenith_deg.values,
            SPECIES[stand]["leaf_angle_distribution"],
            reach.attrs["voxel_size_m"],
            params.per_edge,
        )
        found = compare.likelihood(
            density, truth, params.per_edge, params.range_m, params.neighbours
        )
        estimates += [{"stand": stand, "design": design, "seed": seed} | row for row in found]
    results = {
        "regression": compare.regression_table(cells),
        "factors": compare.factor_table(cells),
        "profile": compare.profile_table(cells, params.cell_size_m),
        "correction": compare.correction_table(cells),
        "estimators": pd.DataFrame(estimates),
    }
    for name, table in results.items():
        tables.write(snakemake.output[name], table)


if __name__ == "__main__":
    run(main, snakemake)
