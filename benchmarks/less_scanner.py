"""The chain on a tree that dapple's own scanner scanned, and that the scanner of LESS 3 scanned.

    python benchmarks/less_scanner.py [--seed 301]

A tree of `other_scanners.py`, from the same positions, in the same angular frame, with the same
brightness of every leaf and branch, and the whole chain with its default settings: shares of shots
without a return and with several, areas over the true ones, and light against that under the true
tree. A row for each scanner and reconstruction goes into docs/data/less_scanner.csv.
"""

import argparse
from pathlib import Path

import pandas as pd
from other_scanners import ROOT, of_tree

from dapple.formats import tables

SCANNERS = {"dapple": {}, "LESS 3": {"program": "less"}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=301)
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    rows = pd.DataFrame(of_tree(options.seed, SCANNERS))
    rows.insert(1, "reconstruction", rows.pop("reconstruction"))
    tables.write(options.docs / "data/less_scanner.csv", rows, "%.4g")
    print(rows.to_string(float_format=lambda value: f"{value:.3f}"))


if __name__ == "__main__":
    main()
