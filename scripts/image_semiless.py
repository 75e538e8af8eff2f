"""Fit the terms of Semi-LESS to images of reference leaves and soils."""

import time

import numpy as np

from dapple.formats import json
from dapple.retrieval import coefficient_files as files
from dapple.retrieval import semiless
from dapple.workflow import options, peak_rss_mb, run


def main(snakemake):
    params = options(snakemake.params)
    coefficients = files.read(snakemake.input.coefficients)
    started = time.perf_counter()
    fitted = semiless.fit(
        coefficients,
        json.read(snakemake.input.sky)["diffuse_share"],
        n_levels=params["levels"],
        structure=params["structure"],
        degree=params["degree"],
        bark=float(np.mean(params["bark"])),
        soils=(0.0, *params["soils"]),
    )
    facts = {
        "seconds": time.perf_counter() - started,
        "peak_rss_mb": peak_rss_mb(),
    }
    files.write_semiless(snakemake.output.semiless, fitted)
    json.write(snakemake.output.facts, facts)
    print(facts)


if __name__ == "__main__":
    run(main, snakemake)
