"""What wood, shoots and the width of pixels do to simulated images, beside the observed ones.

`python benchmarks/canopy.py results/chlorophyll larch` simulates a part of a virtual plot, as it
was rebuilt, with the mean of the true needles and ground there, and divides observed by simulated
canopy reflectance: with facets of leaf alone, with wood, with shoots, and in wider pixels.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple.config.settings import Settings
from dapple.formats import json, rasters
from dapple.frames import direction_from_angles
from dapple.optics.cameras import Camera, camera
from dapple.retrieval import coefficients, image_paths, maps, spectra, training_entries
from dapple.scene import scene_files, traced
from dapple.scene.surfaces import GROUND, LEAF, WOOD, Scene, Surface
from dapple.virtual import plot_optics

EDGE_M = 18.0
"""Of the square in the north-west corner that is simulated."""
VARIANTS = (
    # wood, shoots, edge of pixels [m]
    (False, False, 0.1),
    (True, False, 0.1),
    (True, True, 0.1),
    (True, True, 0.25),
)
PATHS_PER_M2 = 6400
SHOOTS = {"larch": 0.06, "spruce": 0.23}
"""Chance that light meets its own shoot again, found with rays (tests/physics/test_shoots.py)."""


def ratios(folder: Path, name: str) -> pd.DataFrame:
    """Observed over simulated reflectance by variant, mask and band."""
    settings = Settings(**yaml.safe_load((folder / "config.yaml").read_text())).chlorophyll
    plot, path = getattr(settings, name), folder / "plots" / name
    origin_m = json.read(path / "scene/summary.json")["world_origin_m"]
    scene = scene_files.read_plot(
        *(path / f"scene/{part}.ply" for part in ("leaves", "wood", "terrain"))
    )
    observed = rasters.read(path / "world/images.tif")
    heights = rasters.read(path / "scene/chm.tif")
    trees = pd.read_csv(path / "world/trees.csv")
    here = trees.x_m.between(observed.left_m, observed.left_m + EDGE_M)
    here &= trees.y_m.between(observed.top_m - EDGE_M, observed.top_m)
    seen_by = camera(settings.camera_bands)
    seen_as = json.read(path / "world/images.json")
    how = {"near_infrared": seen_by.near_infrared, "sunlit_nir": settings.retrieval.sunlit_nir}
    needles, ground = truth(settings.world, seen_by, trees[here])
    west_north = observed.left_m - origin_m[0], observed.top_m - origin_m[1]
    rows = []
    for wood, shoots, pixel_m in VARIANTS:
        n = round(EDGE_M / pixel_m)
        found = image_paths.trace(
            traced.load(scene if wood else all_leaf(scene), "llvm_ad_rgb"),
            coefficients.Window(*west_north, pixel_m, n, n),
            direction_from_angles(plot.sun_zenith_deg, plot.sun_azimuth_deg),
            n_paths=round(PATHS_PER_M2 * pixel_m**2),
            seed=1,
        )
        image = coefficients.images(
            found,
            coefficients.Combinations(
                *spectra.of_shoots(*needles, SHOOTS[name] if shoots else 0.0),
                np.array(seen_by.at_centres(settings.images.bark_reflectance)),
                ground,
                np.array(seen_as["diffuse_share"]),
            ),
        )
        corner = {"left_m": observed.left_m, "top_m": observed.top_m}
        grid = corner | {"pixel_m": pixel_m, "shape": (n, n)}
        seen = maps.resample(observed, **grid)
        canopy = maps.canopy(
            maps.sample(heights, **grid)[0], min_height_m=settings.retrieval.canopy_height_m
        )
        for mask in training_entries.MASKS:
            chosen = [training_entries.select(x, canopy, mask=mask, **how) for x in (seen, image)]
            value = seen[:, chosen[0]].mean(axis=1) / image[:, chosen[1]].mean(axis=1)
            rows.append((wood, shoots, pixel_m, mask, *value))
    return pd.DataFrame(rows, columns=["wood", "shoots", "pixel_m", "mask", *seen_by.names])


def truth(world, seen_by: Camera, trees: pd.DataFrame):
    """Mean reflectance and transmittance of needles, and mean ground, by band."""
    leaves = plot_optics.needles(
        trees.lcc_ug_cm2.to_numpy(),
        seen_by,
        structure_n=trees.structure_n.to_numpy(),
        dry_matter_g_cm2=trees.dry_matter_g_cm2.to_numpy(),
        brown=trees.brown.to_numpy(),
        water_cm=trees.water_cm.to_numpy(),
        chlorophyll_per_carotenoid=trees.chlorophyll_per_carotenoid.to_numpy(),
    )
    places = np.random.default_rng(1).uniform(0, 50, (2000, 2))
    ground = plot_optics.ground_patches(
        places, seen_by, brightness=world.soil_brightness, moisture=world.soil_moisture,
        litter_share=world.litter_share, variation=world.ground_variation, seed=1,
    )  # fmt: skip
    return [x.mean(axis=0) for x in leaves], ground.mean(axis=0)


def all_leaf(scene: Scene) -> Scene:
    """The same facets, wood taken for leaf."""
    plants = [Surface(one.mesh) for one in (*scene.of(LEAF), *scene.of(WOOD))]
    return Scene([*plants, *scene.of(GROUND)], ground_z_m=scene.ground_z_m)


if __name__ == "__main__":
    print(ratios(Path(sys.argv[1]), sys.argv[2]).round(3).to_string(index=False))
