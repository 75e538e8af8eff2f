"""Bring a user's crowns into the coordinate system of the images, as far as they lie there."""

import numpy as np

from dapple import findings
from dapple.formats import json, rasters, vectors
from dapple.workflow import options, run


def main(snakemake):
    path, settings = snakemake.input.crowns, options(snakemake.params)
    images = rasters.read(snakemake.input.images)
    crowns = vectors.read(path, crs=images.crs, **settings)
    box = (images.left_m, images.bottom_m, images.right_m, images.top_m)
    crowns = vectors.within(crowns, box, path)
    findings.say(crowns.findings)
    vectors.write(snakemake.output.crowns, crowns)
    facts = {
        "path": str(path),
        "crowns": len(crowns.names),
        "with_chlorophyll": int(np.isfinite(crowns.lcc_ug_cm2).sum()),
        "findings": findings.rows(crowns.findings),
    }
    json.write(snakemake.output.facts, facts)


if __name__ == "__main__":
    run(main, snakemake)
