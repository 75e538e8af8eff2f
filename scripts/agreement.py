"""Engines of light against each other, two by two, at the times and sensors that both have."""

from itertools import combinations

from dapple.formats import netcdf, tables
from dapple.sky.open_sky import open_sky_par
from dapple.stats import agreement
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    sky = open_sky_par(netcdf.read(inputs.sky), params.response)
    rows = []
    for engine, reference in combinations(params.engines, 2):
        pairs = zip(inputs[engine], inputs[reference], strict=True)
        for name, (one, other) in zip(params.reconstructions, pairs, strict=True):
            facts = agreement.compare(netcdf.read(one), netcdf.read(other), sky)
            rows.append({"reconstruction": name, "engine": engine, "reference": reference} | facts)
    table = agreement.table(rows)
    print(table.to_string())
    tables.write(snakemake.output.agreement, table)


if __name__ == "__main__":
    run(main, snakemake)
