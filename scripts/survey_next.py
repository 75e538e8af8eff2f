"""Where to scan next, from the scans that there are or from a cloud taken from above."""

import numpy as np
import pandas as pd

from dapple.cloud import ground
from dapple.formats import clouds, shots, tables, voxel_grids
from dapple.survey import airborne, fill, plan
from dapple.workflow import run


def from_scans(inputs, params):
    """Density, kriged where it is unknown, its lower corner, and the places of the scans."""
    density = voxel_grids.read(inputs.voxels)
    guess, _, _ = fill.krige(
        density.plant_area_density_m2_m3.values.astype(np.float64),
        density.standard_error_m2_m3.values.astype(np.float64),
        cell_size_m=density.attrs["voxel_size_m"],
        range_m=params.range_m,
        neighbours=params.neighbours,
    )
    scanned_m = list(shots.read_head(inputs.shots)["scan_positions_m"].values())
    return guess, np.asarray(density.attrs["corner_m"]), np.array(scanned_m).reshape(-1, 3)


def from_above(inputs, params):
    """The same from an airborne cloud, heights counted from the ground; no scan as yet."""
    cloud = clouds.read(inputs.canopy)
    low = ground.lowest(cloud.xyz_m, cell_m=0.5)
    is_ground = ground.cloth(
        cloud.xyz_m[low], cloth_m=1.0, rigidness=2, threshold_m=0.3, where=str(inputs.canopy)
    )
    dem = ground.elevation(cloud.xyz_m[low][is_ground], cloud.xyz_m[:, :2], pixel_m=1.0, crs="")
    guess, corner_m = airborne.canopy_density(
        cloud.xyz_m[:, :2],
        ground.heights(cloud.xyz_m, dem),
        1 / np.maximum(cloud.attributes["NumberOfReturns"], 1),
        cell_size_m=params.cell_size_m,
    )
    return guess, np.append(corner_m, 0.0), np.empty((0, 3))


def main(snakemake):
    params = snakemake.params
    source = from_above if "canopy" in snakemake.input.keys() else from_scans  # noqa: SIM118
    guess, corner_m, scanned_m = source(snakemake.input, params)
    places_m = plan.places(
        guess, params.cell_size_m, scanned_m - corner_m, params.along, params.height_m
    )
    chance = plan.chance_of_return(
        guess,
        places_m,
        cell_size_m=params.cell_size_m,
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
    tables.write(snakemake.output.next, table)


if __name__ == "__main__":
    run(main, snakemake)
