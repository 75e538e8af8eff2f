"""RAMI HET01: fifteen spheres of disc leaves, repeated sideways, in visible and infrared light.

    python benchmarks/rami.py DATA [--docs docs] [--paths N]

DATA holds `het01_UNI_sphere.def` and `het01_UNI_instances.def` of the RAdiation transfer Model
Intercomparison (JRC). Writes fluxes, the nadir gap fraction and the bidirectional reflectance
factor in the principal plane, with standard errors, to docs/data/rami_het01.csv,
docs/data/rami_het01_brf.csv and docs/img/het01_brf.png.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple.formats import meshes, rami
from dapple.frames import direction_from_angles
from dapple.light import brf, visibility
from dapple.scene import patterns, traced
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, Surface

CELL_M = np.array([[-50.0, -50.0], [50.0, 50.0]])
# RAMI counts azimuths from its x axis, along which this scene has its sun: our east.
SUN_ZENITH_DEG, SUN_AZIMUTH_DEG = 20.0, 90.0
OPTICS = Optics.of_tree(
    wavelength_nm=np.array([0.0, 850.0]),
    leaf_reflectance=np.array([0.0, 0.4957]),
    leaf_transmittance=np.array([0.0, 0.4409]),
    wood_reflectance=np.zeros(2),
    ground_reflectance=np.array([0.159, 0.159]),
)
CASES = ("black leaves", "near infrared")


def load(folder: Path, variant: str) -> tuple[traced.TracedScene, float]:
    """The scene and its leaf area index."""
    leaves = meshes.of_discs(rami.read_discs(folder / "het01_UNI_sphere.def"))
    places = rami.read_places(folder / "het01_UNI_instances.def")
    index = leaves.area_m2 * len(places) / float(np.prod(CELL_M[1] - CELL_M[0]))
    scene = traced.load(Scene([Surface(leaves, places_m=places)]), variant, cell_m=CELL_M)
    return scene, index


def gap_fraction(scene: traced.TracedScene, towards: np.ndarray, n: int = 1 << 18):
    """Share of the ground that is seen from a direction, and its standard error."""
    sets = []
    for k, shift in enumerate(np.random.default_rng(1).random((16, 1, 2))):
        square = (patterns.kronecker(n // 16, 2) + shift) % 1.0
        points = np.column_stack([CELL_M[0] + square * (CELL_M[1] - CELL_M[0]), np.zeros(n // 16)])
        seen = visibility.sunlit(
            scene,
            points,
            towards[None],
            tolerance=1.0,
            max_rays=1,
            seed=k,
            n_replicates=2,
            sun_diameter_deg=0.0,
        )
        sets.append(seen.share.mean())
    return np.mean(sets), np.std(sets, ddof=1) / 4


def fluxes(scene: traced.TracedScene, sun: np.ndarray, n_paths: int) -> pd.DataFrame:
    """Upward flux above the canopy, downward flux on the ground, as shares of the sun's; gaps."""
    settings = {"n_paths": n_paths, "max_orders": 250, "seed": 2}
    rows = []
    seen, seen_error = gap_fraction(scene, sun)
    for name, way, height in (("upward above", -1.0, None), ("downward on the ground", 1.0, 0.0)):
        views = brf.over_cell(scene, np.array([[0.0, 0.0, way]]), height_m=height, cosine=True)
        values, errors = brf.reflectance_factor(brf.collect(scene, views, sun, **settings), OPTICS)
        straight, straight_error = (seen, seen_error) if way > 0 else (0.0, 0.0)
        for case, value, error in zip(CASES, values[0], errors[0], strict=True):
            rows.append((name, case, value + straight, np.hypot(error, straight_error)))
    rows.append(("straight on the ground", "both", seen, seen_error))
    rows.append(("gap fraction at nadir", "both", *gap_fraction(scene, np.array([0.0, 0.0, 1.0]))))
    return pd.DataFrame(rows, columns=["quantity", "case", "value", "standard_error"])


def principal_plane(scene: traced.TracedScene, sun: np.ndarray, n_paths: int) -> pd.DataFrame:
    """Reflectance factors; positive view zenith angles are on the side of the sun."""
    angle = np.arange(-75.0, 76.0, 2.0)
    azimuth = np.where(angle < 0, SUN_AZIMUTH_DEG + 180.0, SUN_AZIMUTH_DEG)
    views = brf.over_cell(scene, -direction_from_angles(np.abs(angle), azimuth))
    received = brf.collect(scene, views, sun, n_paths=n_paths, max_orders=250, seed=3)
    value, error = brf.reflectance_factor(received, OPTICS)
    table = {"view_zenith_deg": angle}
    for k, name in enumerate(("black", "nir")):
        table |= {f"brf_{name}": value[:, k], f"standard_error_{name}": error[:, k]}
    return pd.DataFrame(table)


def draw(table: pd.DataFrame, path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), constrained_layout=True)
    for axis, name, title in zip(axes, ("nir", "black"), CASES[::-1], strict=True):
        axis.errorbar(
            table["view_zenith_deg"],
            table[f"brf_{name}"],
            table[f"standard_error_{name}"],
            marker=".",
        )
        axis.axvline(SUN_ZENITH_DEG, color="0.7", linewidth=0.8, zorder=0)
        axis.set(xlabel="view zenith angle [°], positive towards the sun", title=title)
        axis.set_ylim(bottom=0)
    axes[0].set_ylabel("bidirectional reflectance factor")
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[1] / "docs")
    parser.add_argument("--paths", type=int, default=280_000, help="paths of each view")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    options = parser.parse_args()
    scene, index = load(options.data, options.variant)
    sun = direction_from_angles(SUN_ZENITH_DEG, SUN_AZIMUTH_DEG)
    table = fluxes(scene, sun, 4 * options.paths)
    table.loc[len(table)] = ("leaf area index", "both", index, 0.0)
    clock = time.perf_counter()
    plane = principal_plane(scene, sun, options.paths)
    table.loc[len(table)] = ("seconds of the plane", "both", time.perf_counter() - clock, 0.0)
    share = (plane["standard_error_nir"] / plane["brf_nir"]).max()
    table.loc[len(table)] = ("largest relative standard error", "near infrared", share, 0.0)
    table.to_csv(options.docs / "data" / "rami_het01.csv", index=False, float_format="%.6f")
    plane.to_csv(options.docs / "data" / "rami_het01_brf.csv", index=False, float_format="%.6f")
    draw(plane, options.docs / "img" / "het01_brf.png")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
