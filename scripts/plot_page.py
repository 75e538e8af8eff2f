"""One page about a plot: what was read, the map and how far to trust it, trees, figures."""

from pathlib import Path

import pandas as pd

from dapple.formats import json, rasters, tables
from dapple.formats.atomic import atomic
from dapple.report import plot_report
from dapple.workflow import run


def main(snakemake):
    inputs, params = snakemake.input, snakemake.params
    retrieved = [
        plot_report.retrieved(taught, rasters.read(path).values, json.read(facts))
        for taught, path, facts in zip(params.taught, inputs.maps, inputs.intervals, strict=True)
    ]
    page = plot_report.build(
        params.plot,
        files=[json.read(path) for path in inputs.found],
        sun=json.read(inputs.sun),
        sky=dict(zip(params.bands, json.read(inputs.sky)["diffuse_share"], strict=True)),
        sky_told_by=json.read(inputs.sky)["told_by"],
        crs=json.read(inputs.summary)["crs"],
        retrieved=pd.DataFrame(retrieved),
        usual_outside=1.0 - params.range_quantile,
        accuracy=pd.concat([tables.read(path) for path in inputs.accuracy]),
        trees=pd.concat([tables.read(path) for path in inputs.trees]),
        figures=[Path(path) for path in inputs.figures],
    )
    with atomic(snakemake.output.page) as partial:
        partial.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    run(main, snakemake)
