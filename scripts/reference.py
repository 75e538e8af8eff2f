"""Put the timesteps of one reconstruction together."""

from dapple.formats import netcdf
from dapple.light import timestep_series
from dapple.workflow import run


def main(snakemake):
    series = timestep_series.joined(netcdf.read(path) for path in snakemake.input.times)
    netcdf.write(snakemake.output.light, series)


if __name__ == "__main__":
    run(main, snakemake)
