"""Figures of a scan survey."""

import numpy as np
import pandas as pd

from dapple.figures import style, survey_charts
from dapple.workflow import run


def main(snakemake):
    inputs, output = snakemake.input, snakemake.output
    style.save(survey_charts.shadowing(pd.read_csv(inputs.shadowing)), output.shadowing)
    style.save(survey_charts.filled_profiles(pd.read_csv(inputs.filled)), output.filled)
    with np.load(inputs.maps) as maps:
        style.save(survey_charts.shadow_maps(maps, snakemake.params.cell_size_m), output.maps)
    style.save(survey_charts.regressions(pd.read_csv(inputs.regression)), output.regression)
    style.save(survey_charts.corrected_profiles(pd.read_csv(inputs.profile)), output.profile)
    style.save(survey_charts.plan(pd.read_csv(inputs.plan)), output.plan)


if __name__ == "__main__":
    run(main, snakemake)
