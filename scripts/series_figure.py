"""Measured and simulated PAR through the day at chosen sensors."""

import pandas as pd

from dapple.figures import daily_courses, style
from dapple.formats import netcdf, tables
from dapple.stats import measures
from dapple.stats.pairs import simulated
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    if inputs.records:
        records = tables.read(inputs.records)
        r = measures.per_sensor(records)
    else:
        parts = [
            simulated(netcdf.read(path), name)
            for name, path in zip(params.reconstructions, inputs.light, strict=True)
        ]
        records, r = pd.concat(parts, ignore_index=True), None
    chosen = list(params.sensors)
    if not chosen and r is not None:
        chosen = daily_courses.choose_sensors(r, reconstruction=params.reconstructions[0])
    if not chosen:
        chosen = list(records["sensor"].unique()[:: max(1, records["sensor"].nunique() // 6)][:6])
    figure = daily_courses.draw(records, chosen, timezone=params.timezone, per_sensor=r)
    style.save(figure, snakemake.output.figure)


if __name__ == "__main__":
    run(main, snakemake)
