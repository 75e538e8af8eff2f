"""Measured beside simulated light; which records fitted the registration is named."""

import numpy as np
import pandas as pd

from dapple import findings
from dapple.formats import json, netcdf, tables
from dapple.scene.facing import facing_of
from dapple.sky.open_sky import open_sky_par
from dapple.stats import measured, plausible_records, predictive
from dapple.stats.measured import Records
from dapple.stats.pairs import pair
from dapple.stats.predictive import SensorError
from dapple.virtual.sensor_model import simulate
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    registration = json.read(inputs.registration) if inputs.registration else {}
    places = tables.read(inputs.sensors)
    if params.kind == "virtual":
        truth = netcdf.read(inputs.truth)
        records = Records(simulate(truth, **params.sensor_model, seed=params.seed))
    else:
        records = measured.read(inputs.measured, sensors=places, **params.table)
    facing = facing_of(places)
    sky = open_sky_par(netcdf.read(inputs.sky), params.response, facing)
    if facing is not None:
        sky = sky.assign_coords(sensor=list(places["sensor"]))
    table = pd.concat(
        [
            pair(
                netcdf.read(path),
                records.table,
                sky,
                reconstruction=name,
                clock_offset_s=registration.get("clock_offset_s", 0.0),
            )
            for name, path in zip(params.reconstructions, inputs.light, strict=True)
        ],
        ignore_index=True,
    )
    fitted = table["sensor"].isin(registration.get("fitting_sensors", []))
    if until := registration.get("fitting_until"):
        fitted |= table["time"] <= pd.Timestamp(until)
    bounds = predictive.interval(
        table,
        tables.read(inputs.errors),
        SensorError(**params.sensor_error),
        leaves_by_chance=params.leaves_by_chance,
    )
    table = table.join(bounds)
    table["part"] = np.where(fitted, "fitting", "reporting")
    tables.write(snakemake.output.records, table, "%.3f")
    noticed = [*records.findings, *plausible_records.check(table, records.table)]
    findings.say(noticed)
    facts = {"kind": params.kind, **records.facts, "findings": findings.rows(noticed)}
    json.write(snakemake.output.facts, facts)


if __name__ == "__main__":
    run(main, snakemake)
