"""Plant area by every estimator against the true one, by leaf area index and size of leaves.

    python benchmarks/estimators.py table      writes docs/data/estimators.csv
    python benchmarks/estimators.py edges      writes docs/data/estimators_edges.csv

Round leaves with spherical angles lie by chance in a cube of one metre, which four scanners around
it meet with beams that have no width. The true area of a voxel of 0.2 m is that of the parts of
leaves in it. `fpl_with_leaf_area` is told the area of a leaf. Biases are those of the sum over all
voxels that enough beams entered, means over cubes, more of them where leaves are few; `unseen` is
the share of the true area in the others. The grid's facets lie at multiples of 0.2 m, so that four
faces of the cube halve the voxels that they lie in. `edges` tells what these do: the same shots in
that grid, by whether a face of the cube passes through a voxel, and in one that ends at the faces.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "scripts")]

from benchmarks.plant_area import area_by_voxel  # noqa: E402

from dapple.formats import meshes  # noqa: E402
from dapple.formats.shots import Shots  # noqa: E402
from dapple.structure.voxel_sums import Grid  # noqa: E402
from dapple.structure.voxels import plant_area_density  # noqa: E402
from dapple.virtual import scanner  # noqa: E402

INDICES = (0.5, 1.0, 2.0, 4.0, 8.0)
CUBES = {0.01: 1, 0.03: 2, 0.08: 12, 0.15: 24}
"""By the size of leaves [m]."""
SIZE_M, STEP_DEG, MAX_DENSITY = 0.2, 0.15, 40.0
EDGE_INDICES, EDGE_LEAF_M, EDGE_SEEDS = (2.0, 4.0, 8.0), 0.03, (101, 102)


def leaves(leaf_area_index: float, size_m: float, rng: np.random.Generator) -> np.ndarray:
    """Radius, centre and normal (n, 7) of leaves of one size, wholly in a cube of one metre."""
    radius_m = size_m / 2
    n = round(leaf_area_index / (np.pi * radius_m**2))
    normal = rng.standard_normal((n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    centre = radius_m + (1 - 2 * radius_m) * rng.random((n, 3)) + np.array([-0.5, -0.5, 1.0])
    return np.column_stack([np.full(n, radius_m), centre, normal])


def scanned(discs: np.ndarray, seed: int) -> Shots:
    """Shots of four scanners around the cube."""
    return scanner.scan(
        {"leaf": meshes.of_discs(discs, n_sides=8)},
        scanner.positions_around(np.zeros(3), 4.0, 4),
        angular_step_deg=STEP_DEG,
        noise_points_per_shot=0.0,
        range_noise_m=0.0,
        sub_rays=1,
        seed=seed,
    )


def biases(leaf_area_index: float, size_m: float, seed: int) -> dict[str, float]:
    """Relative error of the plant area of one cube by each estimator, and the unseen share."""
    discs = leaves(leaf_area_index, size_m, np.random.default_rng(seed))
    shots = scanned(discs, seed)
    grid = Grid.around(np.array([[-0.5, -0.5, 1.0], [0.5, 0.5, 2.0]]), SIZE_M)
    found = {}
    for told, area_m2 in (("", 0.0), ("_with_leaf_area", np.pi * size_m**2 / 4)):
        voxels = plant_area_density(
            shots, grid, single_leaf_area_m2=area_m2, max_pad_m2_m3=MAX_DENSITY
        )
        true_m2 = area_by_voxel(discs, voxels)
        for name in ("transmittance", "ppl", "fpl", "fpl_biased", "contact_frequency"):
            density = voxels[f"pad_{name}_m2_m3"].to_numpy()
            seen = np.isfinite(density)
            if not told or name == "fpl":
                ratio = density[seen].sum() * SIZE_M**3 / true_m2[seen].sum()
                found[name + told] = float(ratio - 1)
        found["unseen"] = float(true_m2[~seen].sum() / true_m2.sum())
    return found


def table() -> pd.DataFrame:
    """Means over the cubes."""
    rows = []
    for index in INDICES:
        for size_m, n in CUBES.items():
            found = pd.DataFrame([biases(index, size_m, seed) for seed in range(1, n + 1)]).mean()
            rows.append({"leaf_area_index": index, "leaf_size_m": size_m, **found})
            print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def edges() -> pd.DataFrame:
    """Relative errors of free paths in voxels that faces of the cube halve, and in all others."""
    rows = []
    for index in EDGE_INDICES:
        found = []
        for seed in EDGE_SEEDS:
            discs = leaves(index, EDGE_LEAF_M, np.random.default_rng(seed))
            shots = scanned(discs, seed)
            around = Grid.around(np.array([[-0.5, -0.5, 1.0], [0.5, 0.5, 2.0]]), SIZE_M)
            ending = Grid(np.array([-0.5, -0.5, 1.0]), (5, 5, 5), SIZE_M)
            for grid in (around, ending):
                voxels = plant_area_density(
                    shots, grid, contact_voxel_m=0.0, max_pad_m2_m3=MAX_DENSITY
                )
                area_m2 = np.nan_to_num(voxels["pad_fpl_m2_m3"].to_numpy()) * SIZE_M**3
                true_m2 = area_by_voxel(discs, voxels)
                if grid is ending:
                    found.append(("ending_at_faces", area_m2.sum(), true_m2.sum()))
                    continue
                is_halved = np.ones(grid.shape, bool)
                is_halved[1:-1, 1:-1] = False
                for name, own in (("all", ...), ("halved", is_halved), ("whole", ~is_halved)):
                    found.append((name, area_m2[own].sum(), true_m2[own].sum()))
        sums = pd.DataFrame(found, columns=["voxels", "area", "true"]).groupby("voxels").sum()
        ratio = sums["area"] / sums["true"] - 1
        rows.append({"leaf_area_index": index, "leaf_size_m": EDGE_LEAF_M, **ratio.to_dict()})
        print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("table", "edges"))
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data")
    options = parser.parse_args()
    if options.what == "table":
        table().to_csv(options.output / "estimators.csv", index=False, float_format="%.3f")
    else:
        edges().to_csv(options.output / "estimators_edges.csv", index=False, float_format="%.3f")


if __name__ == "__main__":
    main()
