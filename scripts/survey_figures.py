"""Figures of a scan survey."""

import numpy as np

from dapple.figures import style, survey_charts
from dapple.formats import tables
from dapple.workflow import run


def main(snakemake):
    inputs, output = snakemake.input, snakemake.output
    style.save_both(survey_charts.shadowing(tables.read(inputs.shadowing)), output.shadowing)
    style.save_both(survey_charts.filled_profiles(tables.read(inputs.filled)), output.filled)
    with np.load(inputs.maps) as maps:
        style.save_both(survey_charts.shadow_maps(maps, snakemake.params.cell_size_m), output.maps)
    style.save_both(survey_charts.regressions(tables.read(inputs.regression)), output.regression)
    style.save_both(survey_charts.corrected_profiles(tables.read(inputs.profile)), output.profile)
    style.save_both(survey_charts.plan(tables.read(inputs.plan)), output.plan)


if __name__ == "__main__":
    run(main, snakemake)
