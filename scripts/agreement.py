"""Transport engine against the per-timestep engine, at the times that both have."""

from dapple.formats import netcdf, tables
from dapple.sky.open_sky import open_sky_par
from dapple.stats import agreement
from dapple.workflow import run


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    sky = open_sky_par(netcdf.read(inputs.sky), params.response)
    rows = {}
    for name, fast, slow in zip(
        params.reconstructions, inputs.light, inputs.reference, strict=True
    ):
        reference = netcdf.read(slow)
        times = reference["time"]
        rows[name] = agreement.compare(
            netcdf.read(fast).sel(time=times), reference, sky.sel(time=times)
        )
    tables.write(snakemake.output.agreement, agreement.table(rows))


if __name__ == "__main__":
    run(main, snakemake)
