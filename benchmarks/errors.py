"""Is the stated Monte Carlo error of light that of repeated runs? Thirty seeds in one scene.

    python benchmarks/errors.py [--seeds 30] [--docs docs]

For polygons and voxels of a synthetic apple tree: the stated standard error and the scatter of
light between seeds, root mean squares over sensors and times, as shares of the open sky's light,
and the standard deviation and the largest of z, the deviations from the mean over all seeds divided
by the stated errors, over sensors and times at which light differs between seeds: a place that is
in full sun in every seed deviates by nothing. The deviation should be 1
(docs/data/light_errors.csv).
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import crown

from dapple import steps
from dapple.light.light_model import Model, Tracing
from dapple.scene import traced
from dapple.sky.open_sky import open_beam, open_sky_par
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

MODEL = Model(sky_patches=577, max_orders=30)
TRACING = Tracing(
    paths=2048, sky_rays=8192, max_shadow_rays=16384, tolerance=0.005, max_growth=64.0,
    sun_diameter_deg=SUN_DIAMETER_DEG, sun_kernel_deg=8.0,
)  # fmt: skip
KINDS = ("polygons", "voxels_0.2", "voxels_1.0")


def repeated(kind: str, n_seeds: int) -> pd.DataFrame:
    """Stated and actual errors of direct light, of sky and scattered light, and of their sum."""
    scene, sensors_m = traced.load(crown.scene(kind, 60_000), "llvm_ad_mono"), crown.sensors(25)
    sky, optics = crown.sky(12), crown.optics()
    open_sky = open_sky_par(sky).to_numpy()
    beam = open_beam(sky) / open_sky
    light = {part: [] for part in ("direct", "sky and scattered", "all")}
    error = {part: [] for part in light}
    for seed in range(n_seeds):
        sunlit = steps.sun(scene, sensors_m, sky, MODEL, TRACING, seed=1000 + seed)
        counted = steps.paths(
            scene, sensors_m, MODEL, TRACING, optics=crown.optics(4), seed=2000 + seed
        )
        found = steps.products(sunlit, counted, sky, optics, MODEL, TRACING)
        both, of_sun = found.standard_error / open_sky, sunlit.standard_error * beam
        values = found.direct, found.sky + found.scattered, found.par
        errors = of_sun, np.sqrt(np.maximum(both**2 - of_sun**2, 0)), both
        for part, value, stated in zip(light, values, errors, strict=True):
            light[part].append(value / open_sky)
            error[part].append(stated)
    rows = []
    for part in light:
        value, stated = np.array(light[part]), np.array(error[part])
        scatter = (value - value.mean(axis=0)) * np.sqrt(n_seeds / (n_seeds - 1))
        varies = (np.abs(scatter) > 1e-9).any(axis=0)
        z = scatter[:, varies] / stated[:, varies]
        rows.append(
            {"scene": kind, "part": part, "stated": np.sqrt((stated**2).mean()),
             "actual": np.sqrt((scatter**2).mean()), "z_spread": z.std(),
             "z_largest": np.abs(z).max(), "records": varies.sum() * n_seeds}
        )  # fmt: skip
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[1] / "docs")
    options = parser.parse_args()
    table = pd.concat([repeated(kind, options.seeds) for kind in KINDS])
    path = options.docs / "data" / "light_errors.csv"
    table.to_csv(path, index=False, float_format="%.4g")
    print(table.to_string(index=False, float_format=lambda value: f"{value:.4g}"))


if __name__ == "__main__":
    main()
