"""The default filters and classes on scans of scanners that they were not made for.

    python benchmarks/other_scanners.py [--seeds 301 302]

Scans small virtual apple trees (config/stability-small.yaml) with the default scanner and with
others, one thing changed at a time, and runs the whole chain with its default settings: which
points are left and how well they are told apart, leaf area over the true one, and light against
that under the true tree. Means over the trees go into docs/data/other_scanners.csv.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from predictive import setup

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.config.settings import validate  # noqa: E402
from dapple.formats import tables  # noqa: E402
from dapple.formats.clouds import LEAF  # noqa: E402
from dapple.stability.chain import Chain  # noqa: E402
from dapple.stability.stressors import UNDISTURBED  # noqa: E402
from dapple.stats.measures import pearson  # noqa: E402

RECONSTRUCTIONS = ("polygons", "surfels", "voxels_0.2", "voxels_1.0")
SCANNERS: dict[str, dict[str, Any]] = {
    "default": {},
    "all echoes 3 dB weaker": {
        "leaf_reflectance_db": (-11.0, 1.5),
        "wood_reflectance_db": (-5.5, 1.1),
        "noise_reflectance_db": (-19.0, 3.0),
    },
    "all echoes 3 dB stronger": {
        "leaf_reflectance_db": (-5.0, 1.5),
        "wood_reflectance_db": (0.5, 1.1),
        "noise_reflectance_db": (-13.0, 3.0),
    },
    "leaves as bright as bark": {
        "leaf_reflectance_db": (-3.0, 1.5),
        "wood_reflectance_db": (-3.0, 1.5),
    },
    "noise as bright as leaves and as clean": {
        "noise_reflectance_db": (-8.0, 3.0),
        "noise_deviation": 5.0,
    },
    "ten times the noise": {"noise_points_per_shot": 0.01},
    "echoes less clean": {"clean_deviation": 9.0, "clean_deviation_sd": 6.0},
    "ranges to 2 cm": {"range_noise_m": 0.02},
    "beam three times as wide": {"beam_divergence_mrad": 1.05, "exit_aperture_m": 0.02},
    "one return a shot": {"max_returns": 1},
}


def of_tree(seed: int, scanners: dict[str, dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Rows of one tree: each scanner, each reconstruction."""
    path = ROOT / "config/stability-small.yaml"
    usual = setup(validate(yaml.safe_load(path.read_text())))
    first = Chain(usual, seed)
    truth = first.light("truth", UNDISTURBED).par
    open_sky = first.open_sky(UNDISTURBED)
    leaf_area_m2 = first.structure("truth", UNDISTURBED).leaf_area_m2
    wood_area_m2 = first.tree(UNDISTURBED)["wood"].area_m2
    for name, changed in scanners.items():
        chain = Chain(replace(usual, scan=dict(usual.scan) | changed), seed)
        cloud = chain.classes(UNDISTURBED)
        shots = chain.shots(UNDISTURBED)
        common = {
            "scanner": name,
            "points_per_return": len(cloud) / max(len(shots.range_m), 1),
            "misses": np.mean(shots.n_returns == 0),
            "several_returns": np.mean(shots.n_returns > 1),
            "wood_area_rel": chain.polygons(UNDISTURBED)["wood"].area_m2 / wood_area_m2,
            "told_leaf": np.mean(cloud.attributes["Classification"] == LEAF),
        }
        for made in RECONSTRUCTIONS:
            par = chain.light(made, UNDISTURBED).par
            error = (par - truth) / open_sky
            yield common | {
                "reconstruction": made,
                "leaf_area_rel": chain.structure(made, UNDISTURBED).leaf_area_m2 / leaf_area_m2,
                "r": pearson(par.ravel(), truth.ravel()),
                "rmse_rel": np.sqrt(np.mean(error**2)),
                "bias_rel": error.mean(),
            }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[301, 302])
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    rows = pd.DataFrame([row for seed in options.seeds for row in of_tree(seed, SCANNERS)])
    found = rows.groupby(["scanner", "reconstruction"], sort=False).mean().reset_index()
    found.insert(2, "trees", len(options.seeds))
    tables.write(options.docs / "data/other_scanners.csv", found, "%.4g")
    print(found.to_string(float_format=lambda value: f"{value:.3f}"))


if __name__ == "__main__":
    main()
