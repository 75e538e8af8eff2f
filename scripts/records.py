"""Measured beside simulated light; which records fitted the registration is named."""

import numpy as np
import pandas as pd

from dapple.formats import json, netcdf, tables
from dapple.light.series import open_sky_par
from dapple.stats import measured
from dapple.stats.pairs import pair
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    registration = json.read(inputs.registration)
    if params.kind == "virtual":
        records = measured.simulate(
            netcdf.read(inputs.truth),
            noise_relative=params.noise_relative,
            noise_umol_m2_s=params.noise_umol_m2_s,
            calibration_relative=params.calibration_relative,
            clock_offset_s=params.clock_offset_s,
            seed=params.seed,
        )
    else:
        records = measured.read(inputs.measured)
    sky = open_sky_par(netcdf.read(inputs.sky))
    table = pd.concat(
        [
            pair(
                netcdf.read(path),
                records,
                sky,
                reconstruction=name,
                clock_offset_s=registration["clock_offset_s"],
            )
            for name, path in zip(params.reconstructions, inputs.light, strict=True)
        ],
        ignore_index=True,
    )
    fitted = table["sensor"].isin(registration.get("fitting_sensors", []))
    if until := registration.get("fitting_until"):
        fitted |= table["time"] <= pd.Timestamp(until)
    table["part"] = np.where(fitted, "fitting", "reporting")
    tables.write(snakemake.output.records, table, "%.3f")


if __name__ == "__main__":
    run(main, snakemake)
