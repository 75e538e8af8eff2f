"""The Monte Carlo error that is stated is that of repeated runs."""

import numpy as np
import pytest

from benchmarks import crown
from dapple.light import series, transport, visibility
from dapple.scene import traced

N_SEEDS, TOLERANCE = 24, 0.01


@pytest.mark.parametrize("kind", ["polygons", "voxels_0.5"])
def test_deviations_over_stated_errors_have_a_spread_of_one(kind):
    """Light of 24 seeds at 16 sensors and 5 times: z of all records within 1 ± 0.15."""
    scene, sensors_m = traced.load(crown.scene(kind, 8000), "llvm_ad_mono"), crown.sensors(16)
    sky, optics = crown.sky(5, 4), crown.optics(4)
    par, error = [], []
    for seed in range(N_SEEDS):
        sunlit = visibility.sunlit(
            scene, sensors_m, series.towards_sun(sky), tolerance=series.DIRECT_SHARE * TOLERANCE,
            max_rays=1 << 13, seed=seed,
        )  # fmt: skip
        counted = transport.collect(
            scene, sensors_m, n_paths=1024, n_patches=145, max_orders=20, seed=100 + seed,
            tolerance=series.PATH_SHARE * TOLERANCE, optics=optics, n_sky_rays=2320,
        )  # fmt: skip
        light = series.compute(sunlit, counted, sky, optics, sun_kernel_deg=8.0)
        par.append(light.par)
        error.append(light.standard_error)
    scatter = (np.array(par) - np.mean(par, axis=0)) * np.sqrt(N_SEEDS / (N_SEEDS - 1))
    assert (scatter / error).std() == pytest.approx(1, abs=0.15)
    stated, actual = (np.sqrt(np.mean(np.square(x))) for x in (error, scatter))
    assert stated == pytest.approx(actual, rel=0.25)
