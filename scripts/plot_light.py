"""Tell sun and sky of a plot's images: as stated, or from the time and the place of the images."""

from dapple.formats import json, rasters
from dapple.optics.cameras import camera
from dapple.retrieval import flight_light
from dapple.workflow import options, run


def main(snakemake):
    inputs, params = snakemake.input, options(snakemake.params)
    stated = params["stated"]
    images = rasters.read(inputs.images) if inputs.images else None
    sun = flight_light.sun(stated, images)
    sky = flight_light.diffuse_share(
        stated["diffuse_share"], sun["sun_zenith_deg"], camera(params["bands"], *inputs.responses)
    )
    json.write(snakemake.output.sun, sun)
    json.write(snakemake.output.sky, sky)
    print(sun, sky)


if __name__ == "__main__":
    run(main, snakemake)
