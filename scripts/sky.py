"""Sun and sky above the tree at every time."""

import pandas as pd

from dapple.formats import json, netcdf
from dapple.sky.sky_radiance import sky_dataset
from dapple.sky.sun import Site, broadband
from dapple.times import time_range
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    registration = json.read(snakemake.input.registration)
    site = Site(**params.site)
    # The times are the loggers'; their clock may have been ahead of the true time.
    times = time_range(**params.time) - pd.Timedelta(seconds=registration["clock_offset_s"])
    radiation = broadband(times, site, path=snakemake.input.radiation or None, **params.radiation)
    sky = sky_dataset(times, site, radiation, **params.atmosphere)
    netcdf.write(snakemake.output.sky, sky)


if __name__ == "__main__":
    run(main, snakemake)
