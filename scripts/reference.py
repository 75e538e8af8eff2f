"""Put the timesteps of one reconstruction together."""

from dapple.formats import georeference, netcdf, tables
from dapple.light import placed_light, timestep_series
from dapple.workflow import run


def main(snakemake):
    inputs = snakemake.input
    series = timestep_series.joined(netcdf.read(path) for path in inputs.times)
    frame = georeference.read(inputs.cloud, inputs.registration, **snakemake.params.world)
    placed = placed_light.at_sensors(series, tables.read(inputs.sensors), frame)
    netcdf.write(snakemake.output.light, placed)


if __name__ == "__main__":
    run(main, snakemake)
