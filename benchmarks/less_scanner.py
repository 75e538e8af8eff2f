"""The chain on a tree that dapple's own scanner scanned, and that the scanner of LESS 3 scanned.

    python benchmarks/less_scanner.py [--seeds 301 302]

Small virtual apple trees (config/stability-small.yaml), from the same positions, in the same
angular frame, with the same brightness of every leaf and branch, and the whole chain with its
default settings: shots, returns, areas over the true ones, and light against that under the true
tree. A row for each tree, scanner and reconstruction goes into docs/data/less_scanner.csv.
"""

import argparse
import sys
import time
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


def of_tree(seed: int) -> Iterator[dict[str, Any]]:
    """Rows of one tree: each scanner, each reconstruction."""
    path = ROOT / "config/stability-small.yaml"
    usual = setup(validate(yaml.safe_load(path.read_text())))
    first = Chain(usual, seed)
    tree = first.tree(UNDISTURBED)
    truth = first.light("truth", UNDISTURBED).par
    open_sky = first.open_sky(UNDISTURBED)
    for program in ("dapple", "less"):
        chain = Chain(replace(usual, scan=dict(usual.scan) | {"program": program}), seed)
        begun = time.perf_counter()
        shots = chain.shots(UNDISTURBED)
        common = {
            "seed": seed,
            "program": program,
            "scan_wall_s": time.perf_counter() - begun,
            "shots": len(shots),
            "misses": np.mean(shots.n_returns == 0),
            "several_returns": np.mean(shots.n_returns > 1),
            "told_leaf": np.mean(chain.classes(UNDISTURBED).attributes["Classification"] == LEAF),
            "wood_area_rel": chain.polygons(UNDISTURBED)["wood"].area_m2 / tree["wood"].area_m2,
        }
        for made in RECONSTRUCTIONS:
            par = chain.light(made, UNDISTURBED).par
            error = (par - truth) / open_sky
            leaf_area_m2 = chain.structure(made, UNDISTURBED).leaf_area_m2
            yield common | {
                "reconstruction": made,
                "leaf_area_rel": leaf_area_m2 / tree["leaf"].area_m2,
                "r": pearson(par.ravel(), truth.ravel()),
                "rmse_rel": np.sqrt(np.mean(error**2)),
                "bias_rel": error.mean(),
            }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[301, 302])
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    rows = pd.DataFrame([row for seed in options.seeds for row in of_tree(seed)])
    tables.write(options.docs / "data/less_scanner.csv", rows, "%.4g")
    print(rows.to_string(float_format=lambda value: f"{value:.3f}"))


if __name__ == "__main__":
    main()
