"""
Settings of the stability map, and what its rules share. No rules here.

Needs   the configuration
Makes   nothing
"""

from dapple.stability.reconstructions import chosen
from dapple.stability.stressors import STRESSORS

STABILITY = settings.stability
STABILITY_WORLDS = range(1, STABILITY.seeds + 1)
STABILITY_BASE = (
    "leaves.ply",
    "wood.ply",
    "shots.parquet",
    "cloud.ply",
    "seconds.json",
)
# Finer scans and needles fill memory; what they need was measured.
STABILITY_LARGE = {"angular_step": 5000, "leaf_size": 5000}

WORSENED = [name for name in COMPARED if name in JUDGED]

STABILITY_STRESSORS = STABILITY.stressors or tuple(STRESSORS)
STABILITY_RECONSTRUCTIONS = chosen(STABILITY.reconstructions, settings.voxels.sizes_m)


def stability_setup():
    """The configured run that stressors disturb, as `stability.world.Setup` takes it."""
    return {
        "plant": settings.plant.model_dump(),
        "scan": settings.scan.model_dump(),
        "clean": settings.clean.model_dump(exclude={"distance_points"})
        | {"pdal": settings.tools.pdal, "cloudcompare": settings.tools.cloudcompare},
        "classify": settings.classify.model_dump(),
        "polygons": settings.polygons.model_dump()
        | {"voxel_size_m": settings.polygons.nominal_m},
        "surfels": SURFELS,
        "voxels": settings.voxels.model_dump(exclude={"sizes_m"}),
        "sizes_m": settings.voxels.sizes_m,
        "leaves": settings.leaves.model_dump(exclude={"path"}),
        "optics": OPTICS,
        "sensors": settings.sensors.grid(),
        "site": SKY["site"],
        "time": dict(settings.time),
        "radiation": {"linke_turbidity": settings.radiation.linke_turbidity},
        "atmosphere": SKY["atmosphere"],
        "ground_z_m": GROUND_Z_M,
        "fill_range_m": settings.corrections.fill_range_m,
        "light": {
            "variant": f"{VARIANT}_rgb",
            "model": {"bands": STABILITY.bands, **tracing("sky_patches", "max_orders")},
            "tracing": tracing(
                "tolerance",
                "sky_rays",
                "paths",
                "max_shadow_rays",
                "sun_kernel_deg",
                "sun_diameter_deg",
                "aperture_m",
                "response",
            ),
            "truth_factor": STABILITY.truth_factor,
        },
    }


def stability_seed(wildcards):
    """The seed of a world."""
    return stream("stability", wildcards.world)


def stability_base(wildcards):
    """The undisturbed world that batches share."""
    files = (*STABILITY_BASE, "undisturbed.csv")
    return {
        name.split(".")[0]: results(f"stability/base/{wildcards.world}/{name}")
        for name in files
    }


def stability_memory(wildcards, attempt):
    """Memory of a batch [MB]."""
    return memory(STABILITY_LARGE.get(wildcards.stressor, 3000))(wildcards, attempt)


def stability_batches():
    """One table a stressor and world."""
    return [
        results(f"stability/batches/{stressor}_{world}.csv")
        for stressor in STABILITY_STRESSORS
        for world in STABILITY_WORLDS
    ]
