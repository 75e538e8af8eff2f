"""Sun and sky above the tree at every time."""

import pandas as pd

from dapple import findings
from dapple.formats import json, netcdf
from dapple.sky import measured_sky
from dapple.sky.radiation_series import broadband
from dapple.sky.sky_radiance import scaled, sky_dataset
from dapple.sky.sun import Site
from dapple.times import time_range
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    fitted = snakemake.input.registration
    registration = json.read(fitted) if fitted else {"clock_offset_s": 0.0, "gain": 1.0}
    site = Site(**params.site)
    # The times are the loggers'; their clock may have been ahead of the true time.
    times = time_range(**params.time) - pd.Timedelta(seconds=registration["clock_offset_s"])
    radiation = broadband(times, site, path=snakemake.input.radiation or None, **params.radiation)
    findings.say(radiation.findings)
    measured = [measured_sky.read(path).at(times) for path in snakemake.input.sky_table]
    sky = sky_dataset(times, site, radiation.values, *measured, **params.atmosphere)
    sky = scaled(sky, registration["gain"])
    height_deg = 90 - sky["sun_zenith_deg"].to_numpy()
    print(
        f"{len(times)} times, {times[0]} to {times[-1]}, "
        f"sun {height_deg.min():.1f} to {height_deg.max():.1f}° high"
    )
    netcdf.write(snakemake.output.sky, sky)
    facts = radiation.facts | {"findings": findings.rows(radiation.findings)}
    json.write(snakemake.output.radiation, facts)


if __name__ == "__main__":
    run(main, snakemake)
