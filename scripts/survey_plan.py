"""Choose scan positions after a first scan, and compare with designs and with chance."""

import numpy as np
import pandas as pd

from dapple.formats import netcdf, tables, voxel_grids
from dapple.progress import followed
from dapple.streams import stream_seed
from dapple.survey import fill, plan
from dapple.workflow import run

N_RANDOM = 50


def main(snakemake):
    params = snakemake.params
    rows, places = [], []
    inputs = snakemake.input
    stands = list(zip(params.truths, inputs.truth, inputs.candidates, inputs.cells, strict=True))
    for (stand, seed), truth_path, scans_path, cells_path in followed(stands, "plans of stands"):
        truth, scans = netcdf.read(truth_path), netcdf.read(scans_path)
        first = voxel_grids.read(cells_path)
        filled = (truth.leaf_area_m2 + truth.wood_area_m2).values > 0
        hit = scans.hit.values[filled].astype(np.uint32)
        positions_m = scans.attrs["positions_m"].reshape(-1, 3)
        size_m = first.attrs["voxel_size_m"]
        guess, _, _ = fill.krige(
            first.plant_area_density_m2_m3.values.astype(np.float64),
            first.standard_error_m2_m3.values.astype(np.float64),
            cell_size_m=size_m,
            range_m=params.range_m,
            neighbours=params.neighbours,
        )
        chance = plan.chance_of_return(
            guess,
            positions_m,
            cell_size_m=size_m,
            voxel_size_m=truth.attrs["voxel_size_m"],
            zenith_step_deg=float(scans.attrs["zenith_step_deg"]),
            azimuth_step_deg=float(scans.attrs["azimuth_step_deg"]),
        )
        n = min(params.scans, len(positions_m))
        orders, expected = plan.orders(
            chance, guess, positions_m, params.volume_m, n, N_RANDOM, stream_seed(seed, stand)
        )
        for name, several in orders.items():
            measured = np.mean([plan.measured_rs(hit, order) for order in several], axis=0)
            for k, rs in enumerate(measured):
                rows.append(
                    {
                        "stand": stand,
                        "seed": seed,
                        "planner": name,
                        "n_scans": k + 1,
                        "rs": rs,
                        "expected_rs": expected[k] if name == "planner" else np.nan,
                    }
                )
        for k, at in enumerate(orders["planner"][0]):
            x_m, y_m, z_m = positions_m[at]
            places.append({"stand": stand, "seed": seed, "scan": k + 1,
                           "x_m": x_m, "y_m": y_m, "z_m": z_m})  # fmt: skip
    for path, table in ((snakemake.output.plan, rows), (snakemake.output.positions, places)):
        tables.write(path, pd.DataFrame(table))


if __name__ == "__main__":
    run(main, snakemake)
