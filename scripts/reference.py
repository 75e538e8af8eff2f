"""Put the timesteps of one reconstruction together."""

import xarray as xr

from dapple.formats import netcdf
from dapple.workflow import run


def main(snakemake):
    times = [netcdf.read(path) for path in snakemake.input.times]
    series = xr.concat(
        times, "time", data_vars="minimal", coords="minimal", combine_attrs="drop_conflicts"
    )
    netcdf.write(snakemake.output.light, series)


if __name__ == "__main__":
    run(main, snakemake)
