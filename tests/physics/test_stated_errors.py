"""The Monte Carlo error that is stated is that of repeated runs."""

import numpy as np
import pytest
from benchmarks import crown

from dapple import steps
from dapple.light.light_model import Model, Tracing
from dapple.scene import traced
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

N_SEEDS = 24
MODEL = Model(sky_patches=145, max_orders=20, bands=4)
TRACING = Tracing(
    paths=1024, sky_rays=2320, max_shadow_rays=8192, tolerance=0.01, max_growth=64.0,
    sun_diameter_deg=SUN_DIAMETER_DEG, sun_kernel_deg=8.0,
)  # fmt: skip


@pytest.mark.parametrize("kind", ["polygons", "voxels_0.5"])
def test_deviations_over_stated_errors_have_a_spread_of_one(kind):
    """Light of 24 seeds at 16 sensors and 5 times: z of all records within 1 ± 0.15."""
    scene, sensors_m = traced.load(crown.scene(kind, 8000), "llvm_ad_mono"), crown.sensors(16)
    sky, optics = crown.sky(5, 4), crown.optics(4)
    par, error = [], []
    for seed in range(N_SEEDS):
        sunlit = steps.sun(scene, sensors_m, sky, MODEL, TRACING, seed=seed)
        counted = steps.paths(scene, sensors_m, MODEL, TRACING, optics=optics, seed=100 + seed)
        light = steps.products(sunlit, counted, sky, optics, MODEL, TRACING)
        par.append(light.par)
        error.append(light.standard_error)
    scatter = (np.array(par) - np.mean(par, axis=0)) * np.sqrt(N_SEEDS / (N_SEEDS - 1))
    assert (scatter / error).std() == pytest.approx(1, abs=0.15)
    stated, actual = (np.sqrt(np.mean(np.square(x))) for x in (error, scatter))
    assert stated == pytest.approx(actual, rel=0.25)


def test_four_times_as_many_rays_promise_half_the_error():
    finer = TRACING.finer(4)
    assert (finer.paths, finer.sky_rays, finer.max_shadow_rays) == (4096, 9280, 32_768)
    assert finer.tolerance == pytest.approx(0.005)
