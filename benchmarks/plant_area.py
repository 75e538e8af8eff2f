"""Do intervals of plant area hold the truth in as many cases as they say?

    python benchmarks/plant_area.py learn         constants of structure/plant_area.py and
                                                  docs/data/plant_area_{sizes,spread}.csv, on 120
                                                  crowns
    python benchmarks/plant_area.py judge         docs/data/plant_area{,_crowns}.csv, on 60 others

Crowns are discs in a ball, evenly or in clumps, scanned from one to eight places with beams that
have no width. The true area of a voxel is that of the parts of discs that lie in it. Voxels of
0.2 m are not told the area of a disc, those of 0.1 m are; to learn, every size is done both ways.
Ten of the judged crowns are scanned once more with beams as wide as a scanner's: no interval knows
of those.
"""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.formats import meshes  # noqa: E402
from dapple.formats.shots import Shots  # noqa: E402
from dapple.structure import plant_area  # noqa: E402
from dapple.structure.voxel_sums import Grid  # noqa: E402
from dapple.structure.voxels import plant_area_density  # noqa: E402
from dapple.virtual import scanner  # noqa: E402

LEARNED, JUDGED = range(120), range(3000, 3060)
WIDE = range(3000, 3010)
FILL_RANGE_M, MOST_DISCS, PARTS = 0.5, 12_000, 48
CLUMP_DISCS, CLUMP_M = 20, 0.08
USUAL = ((0.2, False), (0.1, True))
"""Edge of voxels [m], and whether they are told the area of a disc."""
BOTH = ((0.2, False), (0.2, True), (0.1, False), (0.1, True))
SPREADS = (0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08)
"""Standard deviations between crowns or layers that may be chosen from."""
MOST_DENSITY = 4.0
"""Cap of density times size [m² m⁻²]."""
ENOUGH_SHOTS, MOST_FILLED = 30, 0.1
"""Median over voxels that are entered at all, below which they are too small for a scan; share of
the area in filled voxels, above which a crown says little of what seen voxels hide."""


def crown(rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """Radius, centre and normal of discs (n, 7), and their mean area [m²]."""
    half_m = rng.uniform([0.4, 0.4, 0.4], [1.0, 1.0, 1.0])
    radius_m = np.exp(rng.uniform(np.log(0.01), np.log(0.04)))
    density = rng.uniform(0.5, 5.0)
    n = int(4 / 3 * np.pi * half_m.prod() * density / (np.pi * radius_m**2))
    if n > MOST_DISCS:
        radius_m, n = radius_m * np.sqrt(n / MOST_DISCS), MOST_DISCS
    is_clumped = rng.random() < 0.5
    clumps = rng.standard_normal((max(n // CLUMP_DISCS, 1), 3))
    places = clumps if is_clumped else rng.standard_normal((n, 3))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    places *= half_m * rng.random((len(places), 1)) ** (1 / 3)
    if is_clumped:
        places = places[rng.integers(0, len(places), n)]
        places = places + CLUMP_M * rng.standard_normal((n, 3))
    normal = rng.standard_normal((n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    own_m = radius_m * np.sqrt(rng.uniform(0.5, 1.5, n))
    return np.column_stack([own_m, places + np.array([0, 0, 1.6]), normal]), float(
        np.pi * radius_m**2
    )


def area_by_voxel(discs: np.ndarray, voxels: xr.Dataset) -> np.ndarray:
    """True area in every voxel: that of 48 equal parts of each disc [m²]."""
    k = np.arange(PARTS)
    out, turn = np.sqrt((k + 0.5) / PARTS), k * np.pi * (3 - np.sqrt(5))
    normal = discs[:, 4:]
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normal, across)
    parts = (out * np.cos(turn))[:, None] * across[:, None]
    parts = parts + (out * np.sin(turn))[:, None] * along[:, None]
    places = discs[:, None, 1:4] + discs[:, 0, None, None] * parts
    shape = tuple(voxels.sizes[axis] for axis in "xyz")
    size_m = voxels.attrs["voxel_size_m"]
    index = np.floor((places.reshape(-1, 3) - voxels.attrs["corner_m"]) / size_m).astype(int)
    flat = np.ravel_multi_index(tuple(np.clip(index, 0, np.array(shape) - 1).T), shape)
    area = np.repeat(np.pi * discs[:, 0] ** 2 / PARTS, PARTS)
    return np.bincount(flat, area, int(np.prod(shape))).reshape(shape)


def fired(seed: int, *, is_wide: bool = False) -> tuple[Shots, np.ndarray, float, int]:
    """Shots at a crown, its discs, area of an element [m²] and number of positions."""
    rng = np.random.default_rng(seed)
    discs, element_m2 = crown(rng)
    positions = int(rng.choice([1, 2, 3, 4, 6, 8]))
    mesh = meshes.of_discs(discs)
    beam = {} if is_wide else {"sub_rays": 1, "range_noise_m": 0.0}
    shots = scanner.scan(
        {"leaf": mesh},
        scanner.positions_around(np.zeros(3), 4.0, positions),
        angular_step_deg=float(np.exp(rng.uniform(np.log(0.12), np.log(1.2)))),
        noise_points_per_shot=0.0,
        seed=seed,
        **beam,
    )
    return shots, discs, element_m2, positions


def bounds_m(discs: np.ndarray) -> np.ndarray:
    """Lowest and highest corner of all discs, (2, 3)."""
    vertices_m = meshes.of_discs(discs).vertices_m
    return np.array([vertices_m.min(axis=0), vertices_m.max(axis=0)])


def compared(
    seed: int, sizes: Iterable[tuple[float, bool]], *, is_wide: bool = False
) -> pd.DataFrame:
    """Estimated and true areas of the voxels, layers and the whole of a crown, by size."""
    shots, discs, element_m2, positions = fired(seed, is_wide=is_wide)
    rows = []
    for size_m, is_told in sizes:
        voxels = plant_area_density(
            shots,
            Grid.around(bounds_m(discs), size_m),
            contact_voxel_m=0,
            max_pad_m2_m3=MOST_DENSITY / size_m,
            single_leaf_area_m2=element_m2 if is_told else 0.0,
        )
        number = voxels["n_shots"].to_numpy()
        facts = {
            "size_m": size_m,
            "has_leaf_area": is_told,
            "crown": seed,
            "positions": positions,
            "element_m2": element_m2,
            "median_shots": float(np.median(number[number > 0])),
            "is_wide": is_wide,
        }
        rows.append(parts_of(voxels, area_by_voxel(discs, voxels), element_m2).assign(**facts))
    return pd.concat(rows, ignore_index=True)


def parts_of(voxels: xr.Dataset, true_m2: np.ndarray, element_m2: float) -> pd.DataFrame:
    """Areas of voxels, layers and the crown, estimated and true."""
    found = plant_area.of_voxels(voxels, element_area_m2=element_m2, fill_range_m=FILL_RANGE_M)
    low_m2, high_m2 = plant_area.interval_m2(found.area_m2, found.variance_m4)
    size_m = voxels.attrs["voxel_size_m"]
    beams_m2 = 1.96 * voxels["standard_error_m2_m3"].to_numpy() * size_m**3
    in_crown = (true_m2 > 0) | (found.area_m2 > 0)
    of_voxels = pd.DataFrame(
        {
            "part": np.where(found.is_filled, "voxel filled", "voxel seen")[in_crown],
            "true_m2": true_m2[in_crown],
            "plant_area_m2": found.area_m2[in_crown],
            "likely_m2": found.area_m2[in_crown],
            "low_m2": low_m2[in_crown],
            "high_m2": high_m2[in_crown],
            "beams_alone": (np.abs(found.area_m2 - true_m2) <= beams_m2)[in_crown],
        }
    )
    parts = plant_area.by_part(found)
    for spread in SPREADS:
        other = plant_area.by_part(found, of_crown=spread, of_layer=spread)
        parts[[f"low_m2 {spread}", f"high_m2 {spread}"]] = other[["low_m2", "high_m2"]]
    parts["true_m2"] = [true_m2.sum(), *true_m2.sum(axis=(0, 1))]
    seen_m2 = np.where(found.is_filled, 0.0, found.area_m2)
    parts["area_per_face"] = (seen_m2**2).sum() / max(seen_m2.sum(), 1e-300) / size_m**2
    parts = parts[parts["true_m2"] > 0].drop(columns="height_m")
    return pd.concat([of_voxels, parts], ignore_index=True)


def constants(rows: pd.DataFrame) -> dict[str, float]:
    """HIDDEN, LARGE and UNTOLD of structure/plant_area.py by least squares over whole crowns."""
    crowns = rows[(rows["part"] == "crown") & rows["is_dense"]]
    crowns = crowns[crowns["filled_share"] < MOST_FILLED]
    of_leaf = crowns["element_m2"] / crowns["size_m"] ** 2
    terms = np.column_stack(
        [crowns["area_per_face"], -of_leaf, -of_leaf.where(~crowns["has_leaf_area"], 0.0)]
    )
    hidden = crowns["true_m2"] / crowns["plant_area_m2"] - 1
    found = np.linalg.lstsq(terms, hidden.to_numpy(), rcond=None)[0]
    return dict(zip(("HIDDEN", "LARGE", "UNTOLD"), found.round(3).tolist(), strict=True))


def of_sizes(rows: pd.DataFrame) -> pd.DataFrame:
    """Errors over crowns that at least four positions scanned densely, by size and leaf area."""
    crowns = rows[(rows["part"] == "crown") & (rows["positions"] >= 4)]
    dense = crowns[crowns.groupby("crown")["is_dense"].transform("all")]
    dense = dense.assign(error=dense["plant_area_m2"] / dense["true_m2"] - 1)
    found = dense.groupby(["size_m", "has_leaf_area"], sort=False)["error"]
    return found.agg(
        crowns="size",
        mean="mean",
        mean_absolute=lambda error: error.abs().mean(),
        within_3_percent=near,
    ).reset_index()


def near(error: pd.Series) -> float:
    """Share of relative errors within 3 %."""
    return float((error.abs() <= 0.03).mean())


def is_held(rows: pd.DataFrame, spread: str = "") -> pd.Series:
    """Whether the true area lies in the interval, as it is or with another spread."""
    low_m2, high_m2 = rows[f"low_m2{spread}"], rows[f"high_m2{spread}"]
    return (rows["true_m2"] >= low_m2 - 1e-9) & (rows["true_m2"] <= high_m2 + 1e-9)


def groups_of(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Crowns that are told apart, by how they were scanned."""
    thin = rows[~rows["is_wide"]]
    dense = thin[thin["is_dense"]]
    return {
        "all": thin,
        "few shots a voxel": thin[~thin["is_dense"]],
        "1 position": dense[dense["positions"] == 1],
        "2 or 3 positions": dense[dense["positions"].isin([2, 3])],
        "4 to 8 positions": dense[dense["positions"] >= 4],
        "beams with a width": rows[rows["is_wide"]],
    }


def of_spreads(rows: pd.DataFrame) -> pd.DataFrame:
    """Share of true areas within the intervals that each spread between crowns or layers gives."""
    found = []
    for name, group in groups_of(rows[rows["part"].isin(["crown", "layer"])]).items():
        for (part, size_m), own in group.groupby(["part", "size_m"], sort=False):
            of_one = {"part": part, "size_m": size_m, "crowns": name, "cases": len(own)}
            held = {spread: is_held(own, f" {spread}").mean() for spread in SPREADS}
            found += [of_one | {"spread": one, "coverage": share} for one, share in held.items()]
    return pd.DataFrame(found)


def coverage(rows: pd.DataFrame) -> pd.DataFrame:
    """Share of true areas within the intervals, by part and for some groups of crowns."""
    width = (rows["high_m2"] - rows["low_m2"]) / rows["plant_area_m2"]
    rows = rows.assign(held=is_held(rows), width=width)
    found = []
    for name, group in groups_of(rows).items():
        for (part, size_m), own in group.groupby(["part", "size_m"], sort=False):
            error = own[["plant_area_m2", "likely_m2"]].div(own["true_m2"], axis=0) - 1
            found.append(
                {
                    "part": part,
                    "size_m": size_m,
                    "crowns": name,
                    "cases": len(own),
                    "coverage": own["held"].mean(),
                    "coverage_of_beams_alone": own["beams_alone"].astype(float).mean(),
                    "bias": own["plant_area_m2"].sum() / own["true_m2"].sum() - 1,
                    "bias_likely": own["likely_m2"].sum() / own["true_m2"].sum() - 1,
                    "within_3_percent": near(error["plant_area_m2"]),
                    "likely_within_3_percent": near(error["likely_m2"]),
                    "median_width": own["width"].replace(np.inf, np.nan).median(),
                }
            )
    order = ["part", "size_m"]
    return pd.DataFrame(found).sort_values(order, ascending=[True, False], kind="stable")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("learn", "judge"))
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    folder = options.docs / "data"
    learns = options.what == "learn"
    rows = [compared(seed, BOTH if learns else USUAL) for seed in (LEARNED if learns else JUDGED)]
    if not learns:
        rows += [compared(seed, USUAL, is_wide=True) for seed in WIDE]
    rows = pd.concat(rows, ignore_index=True)
    rows["is_dense"] = rows["median_shots"] >= ENOUGH_SHOTS
    if learns:
        print(constants(rows))
        sizes = of_sizes(rows)
        sizes.to_csv(folder / "plant_area_sizes.csv", index=False, float_format="%.4g")
        print(sizes.to_string())
        rows = rows[rows["has_leaf_area"] == (rows["size_m"] == USUAL[1][0])]
        spreads = of_spreads(rows)
        spreads.to_csv(folder / "plant_area_spread.csv", index=False, float_format="%.4g")
    table = coverage(rows)
    print(table.to_string())
    if not learns:
        others = [name for name in rows if name.startswith(("low_m2 ", "high_m2 "))]
        dropped = ["part", "beams_alone", "is_dense", *others]
        crowns = rows[rows["part"] == "crown"].drop(columns=dropped)
        table.to_csv(folder / "plant_area.csv", index=False, float_format="%.4g")
        crowns.to_csv(folder / "plant_area_crowns.csv", index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
