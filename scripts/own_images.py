"""Bring a user's images into the bands of the camera and the coordinate system of the cloud."""

import laspy

from dapple import findings
from dapple.formats import cloud_crs, json, rasters, user_rasters
from dapple.optics.cameras import camera
from dapple.workflow import options, run


def main(snakemake):
    inputs, params = snakemake.input, options(snakemake.params)
    crs = cloud_crs.horizontal(inputs.lidar, params["crs"])
    with laspy.open(inputs.lidar) as file:
        bounds_m = (*file.header.mins[:2], *file.header.maxs[:2])
    images = inputs.images if isinstance(inputs.images, str) else list(inputs.images)
    found = user_rasters.read(
        images, camera(params["bands"]).bands, crs=crs, bounds_m=bounds_m, **params["how"]
    )
    findings.say(found.findings)
    rasters.write(snakemake.output.images, found.raster)
    json.write(snakemake.output.facts, found.facts | {"findings": findings.rows(found.findings)})


if __name__ == "__main__":
    run(main, snakemake)
