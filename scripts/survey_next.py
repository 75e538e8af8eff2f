"""Where to scan next, from the scans that there are."""

import numpy as np
import pandas as pd

from dapple.formats import shots, voxels
from dapple.formats.atomic import atomic
from dapple.survey import fill, plan
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    density = voxels.read(snakemake.input.voxels)
    corner_m, size_m = np.asarray(density.attrs["corner_m"]), density.attrs["voxel_size_m"]
    guess, _, _ = fill.krige(
        density.plant_area_density_m2_m3.values.astype(np.float64),
        density.standard_error_m2_m3.values.astype(np.float64),
        cell_size_m=size_m,
        range_m=params.range_m,
        neighbours=params.neighbours,
    )
    head = shots.read_head(snakemake.input.shots)
    scanned_m = np.array(list(head["scan_positions_m"].values()), float).reshape(-1, 3)
    places_m = plan.places(guess, size_m, scanned_m - corner_m, params.along)
    chance = plan.chance_of_seeing(
        guess,
        places_m,
        cell_size_m=size_m,
        voxel_size_m=params.voxel_size_m,
        zenith_step_deg=params.zenith_step_deg,
        azimuth_step_deg=params.azimuth_step_deg,
    )
    taken = tuple(range(len(scanned_m)))
    n = min(len(taken) + params.scans, len(places_m))
    order, expected = plan.choose(chance, guess, n, taken)
    table = pd.DataFrame(places_m[order] + corner_m, columns=["x_m", "y_m", "z_m"])
    table.insert(0, "scan", np.arange(1, n + 1))
    table["scanned"] = np.arange(n) < len(taken)
    table["expected_rs"] = expected
    with atomic(snakemake.output.next) as partial:
        table.to_csv(partial, index=False, float_format="%.4g")


if __name__ == "__main__":
    run(main, snakemake)
