"""How many beams a second of processor time, and how much memory a hectare of trees takes.

    PYTHONPATH=scripts python benchmarks/survey.py [--beams 1e6] [--edge 100]

Beams of seven rays each through a stand of four full-grown trees, with and without following them
through 10 cm voxels; then a square stand of that density, made of two trees by instances. The table
goes to docs/data/survey_beams.csv.
"""

import argparse
import resource
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple.survey import designs, hemisphere
from dapple.survey.hemisphere_scanner import Hemisphere
from dapple.survey.voxel_status import Reach
from dapple.virtual import stands
from dapple.virtual.box_grids import grid_shape
from dapple.virtual.stand_species import SPECIES

ROOT = Path(__file__).parents[1]
SPACING_M = 7.5


def square(species: str, edge_m: float, leaf_area_index: float = 4.5) -> stands.Stand:
    """A square stand with a tree in the middle of every square of `SPACING_M`."""
    middle = np.arange(0.5 * SPACING_M, edge_m, SPACING_M)
    places = np.stack(np.meshgrid(middle, middle), axis=-1).reshape(-1, 2)
    size_m = (edge_m, edge_m, 30.0)
    return stands.grow(species, places, size_m=size_m, leaf_area_index=leaf_area_index, seed=1)


def fire(stand: stands.Stand, n_beams: float, reach: Reach | None) -> tuple[int, float]:
    """Beams of one scan in the middle of a stand, and the processor time [s] that they take."""
    step_deg = 360 * 360 / n_beams  # 0.25 degrees of zenith are 360 rows
    scanner = Hemisphere(azimuth_steps_deg=(step_deg,))
    (place_m,) = designs.positions("single", stand.size_m, 1.3)
    world = hemisphere.world_of(stand)
    beams = hemisphere.scan(world, stand, place_m, scanner, 1, seed=1)
    chunk = next(beams)  # compiles the kernels
    if reach is not None:
        reach.add(chunk)
    count, begun = 0, time.process_time()
    for chunk in beams:
        count += len(chunk.direction)
        if reach is not None:
            reach.add(chunk)
    return count, time.process_time() - begun


def described(name: str, stand: stands.Stand) -> dict[str, str | int]:
    """How large a stand is, and what is stored of it."""
    triangles = sum(len(p.leaves.faces) + len(p.wood.faces) for p in stand.plants)
    return {"stand": name, "trees": len(stand.grown), "triangles_stored": triangles}


def peak_gb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--beams", type=float, default=1e6)
    parser.add_argument("--edge", type=float, default=100.0, help="of the large stand, m")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs" / "data")
    options = parser.parse_args()
    rows = []
    for species in SPECIES:
        stand = square(species, 15.0)
        shape = grid_shape(stand.size_m, 0.1)
        row = described(species, stand)
        for what, reach in (("scanned", None), ("followed", Reach.empty(shape, 0.1))):
            count, seconds = fire(stand, options.beams, reach)
            row[f"{what}_per_s"] = count / seconds
        rows.append(row | {"peak_gb": peak_gb()})
    stand = square("fagus", options.edge)
    count, seconds = fire(stand, options.beams, None)
    large = described(f"fagus on {options.edge:g} m", stand)
    rows.append(large | {"scanned_per_s": count / seconds, "peak_gb": peak_gb()})
    table = pd.DataFrame(rows)
    print(table.to_string(index=False))
    table.to_csv(options.docs / "survey_beams.csv", index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
