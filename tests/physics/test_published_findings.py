"""What Frey et al. (2025) found under one apple tree holds in a virtual world, and where it ends.

Polygons follow light better than voxels of 0.2 m, and these better than voxels of 1 m; under
polygons it is brighter than under voxels although they have more leaf area. The last depends on how
densely the tree was scanned: polygons grow with every beam, voxels do not.
"""

import pytest

from dapple.config.settings import Settings
from dapple.sky.solar_disc import SUN_DIAMETER_DEG
from dapple.stability import outcome
from dapple.stability.chain import Chain
from dapple.stability.stressors import Conditions
from dapple.stability.world import Setup

RECONSTRUCTIONS = ("polygons", "voxels_0.2", "voxels_1.0")
TREE = {
    "height_m": 3.4,
    "crown_base_m": 1.0,
    "crown_radius_m": 1.5,
    "dbh_m": 0.08,
    "leaf_area_m2": 13.0,
}
LIGHT = {
    "variant": "llvm_ad_rgb",
    "model": {"bands": 3, "sky_patches": 145, "max_orders": 4},
    "tracing": {
        "tolerance": 0.0125,
        "sky_rays": 2320,
        "paths": 512,
        "max_shadow_rays": 512,
        "sun_diameter_deg": SUN_DIAMETER_DEG,
        "aperture_m": 0.0,
        "sun_kernel_deg": 8.0,
    },
    "truth_factor": 4,
}


@pytest.fixture(scope="module")
def world() -> Chain:
    """A small tree with ordinary leaves, the scanner of the published study around it."""
    settings = Settings()
    atmosphere = {"model": settings.radiation.sky}
    setup = Setup(
        plant=settings.plant.model_dump() | TREE,
        scan=settings.scan.model_dump() | {"window_margin_m": 0.3},
        clean=settings.clean.model_dump(exclude={"distance_points"})
        | {"outlier_backend": "none", "pdal": settings.tools.pdal},
        classify=settings.classify.model_dump(),
        polygons=settings.polygons.model_dump(),
        surfels=settings.surfels.model_dump() | {"max_deviation": settings.clean.max_deviation},
        voxels=settings.voxels.model_dump(exclude={"sizes_m"}) | {"contact_voxel_m": 0.0},
        leaves={},
        sensors={"columns": 8, "rows": 8, "spacing_m": 0.45, "height_m": 0.1},
        site=settings.site.model_dump(exclude={"timezone", "crs"}),
        time=dict(settings.time) | {"step_min": 20.0},
        radiation={"linke_turbidity": 3.0},
        atmosphere=atmosphere,
        light=LIGHT,
    )
    return Chain(setup, seed=2)


def agreement(
    world: Chain, conditions: Conditions, reconstructions: tuple[str, ...] = RECONSTRUCTIONS
) -> dict[str, dict[str, float]]:
    """Agreement with the true light, and leaf area, by reconstruction."""
    truth, open_sky = world.light("truth", conditions), world.open_sky(conditions)
    return {
        name: outcome.agreement(world.light(name, conditions).par, truth.par, open_sky)
        | {"leaf_area_m2": world.structure(name, conditions).leaf_area_m2}
        for name in reconstructions
    }


@pytest.mark.parametrize("sharp", ["polygons", "surfels"])
def test_the_published_order_and_the_published_paradox(world, sharp):
    names = (sharp, "voxels_0.2", "voxels_1.0")
    found = agreement(world, Conditions(angular_step_deg=0.09), names)
    r = [found[name]["r"] for name in names]
    assert r[0] > r[1] > r[2]
    leaves, voxels = found[sharp], found["voxels_0.2"]
    assert leaves["leaf_area_m2"] > voxels["leaf_area_m2"]
    assert leaves["mean_par_rel"] > voxels["mean_par_rel"]


def test_few_beams_starve_polygons_and_leave_voxels_alone(world):
    dense, sparse = (agreement(world, Conditions(angular_step_deg=s)) for s in (0.11, 0.25))
    assert sparse["polygons"]["r"] < sparse["voxels_0.2"]["r"]
    assert sparse["polygons"]["leaf_area_m2"] < 0.5 * dense["polygons"]["leaf_area_m2"]
    assert sparse["voxels_0.2"]["r"] == pytest.approx(dense["voxels_0.2"]["r"], abs=0.02)


def test_sensors_in_the_wrong_place_hurt_polygons_most(world):
    found = agreement(world, Conditions(angular_step_deg=0.11, sensor_error_m=0.1))
    assert found["polygons"]["r"] < found["voxels_0.2"]["r"]
