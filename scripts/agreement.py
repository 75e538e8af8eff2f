"""Transport engine against the per-timestep engine, at the times that both have."""

from dapple.formats import netcdf
from dapple.formats.atomic import atomic
from dapple.light.series import open_sky_par
from dapple.stats import agreement
from dapple.workflow import run


def main(snakemake):
    inputs = snakemake.input
    sky = open_sky_par(netcdf.read(inputs.sky))
    rows = {}
    for name, fast, slow in zip(
        snakemake.params.reconstructions, inputs.light, inputs.reference, strict=True
    ):
        reference = netcdf.read(slow)
        times = reference["time"]
        rows[name] = agreement.compare(
            netcdf.read(fast).sel(time=times), reference, sky.sel(time=times)
        )
    with atomic(snakemake.output.agreement) as partial:
        agreement.table(rows).to_csv(partial, index=False, float_format="%.6g")


if __name__ == "__main__":
    run(main, snakemake)
