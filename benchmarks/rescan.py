"""Does rescan rank reconstructions as their light does?

    python benchmarks/rescan.py [--seeds 1 2 3] [--docs docs]

Small virtual trees are scanned from three places and rebuilt from two of them, by polygons, surfels
and voxels with several settings. Each reconstruction predicts the shots from the third place, and
the share of the sun's disc that sensors see under it is compared with that under the true tree
(docs/data/rescan.csv). Spearman's rank correlation of the error of light with each score, over the
reconstructions of a tree and over all, stands in docs/data/rescan_ranks.csv: 1 is a perfect judge.
By how much the setting that a score would choose errs more than the best one of the same tree and
kind, `any` being the best of all kinds, stands in docs/data/rescan_choices.csv.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
import yaml

import surfels as by_surfels

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple import steps
from dapple.config.settings import Settings
from dapple.formats import shots
from dapple.formats.clouds import Cloud
from dapple.streams import stream_seed
from dapple.structure.stem import stem_position
from dapple.virtual import scanner
from dapple.virtual.left_out import seen_from
from dapple.virtual.plants import apple_tree

ROOT = Path(__file__).parents[1]
POLYGONS_M = (0.03, 0.05, 0.08, 0.15)
OVERLAPS = (0.6, 1.2, 2.4)
VOXELS_M = (0.1, 0.2, 0.5)
LEFT_OUT = 2
"""Number of the position that is predicted."""
SCORES = {"right_share": -1, "hit_or_pass_share": -1, "gap_rmse": 1, "range_near_share": -1}
"""What may rank; -1 where more is better."""
NEAR_BEST = 0.1
"""A choice is good whose error of light is at most so much above the least."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    small = yaml.safe_load((ROOT / "config" / "virtual-apple-small.yaml").read_text())
    small["sensors"] = {"columns": 6, "rows": 6, "spacing_m": 0.3}
    rows = []
    for seed in options.seeds:
        settings = Settings.model_validate(small | {"seed": seed})
        for row in rescanned(settings):
            rows.append({"tree": seed} | row)
            print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    ranks = []
    groups = [*((str(tree), own) for tree, own in table.groupby("tree")), ("all", table)]
    groups.append(("all but voxels", table[table["reconstruction"] != "voxels"]))
    for tree, own in groups:
        light = own["rmse"].rank()
        found = {name: sign * own[name].rank().corr(light) for name, sign in SCORES.items()}
        ranks.append({"tree": tree, "reconstructions": len(own)} | found)
    folder = options.docs / "data"
    table.to_csv(folder / "rescan.csv", index=False, float_format="%.4g")
    pd.DataFrame(ranks).to_csv(folder / "rescan_ranks.csv", index=False, float_format="%.3g")
    chosen = choices(table)
    chosen.to_csv(folder / "rescan_choices.csv", index=False, float_format="%.3g")
    print(pd.DataFrame(ranks).to_string(), chosen.to_string(), sep="\n")


def choices(table: pd.DataFrame) -> pd.DataFrame:
    """What each score would choose, of every kind of reconstruction and of all, over the trees."""
    kinds = [*table.groupby("reconstruction"), ("any", table)]
    rows = []
    for kind, of_kind in kinds:
        trees = [own for _, own in of_kind.groupby("tree")]
        for score, sign in SCORES.items():
            picked = [own.loc[(sign * own[score]).idxmin(), "rmse"] for own in trees]
            above = [rmse / own["rmse"].min() - 1 for rmse, own in zip(picked, trees, strict=True)]
            rows.append(
                {
                    "reconstruction": kind,
                    "score": score,
                    "trees": len(trees),
                    "near_best": sum(one <= NEAR_BEST for one in above),
                    "worst_above_best": max(above),
                    "worst_setting_above_best": max(
                        own["rmse"].max() / own["rmse"].min() - 1 for own in trees
                    ),
                }
            )
    return pd.DataFrame(rows)


def rescanned(settings: Settings) -> Iterator[dict[str, Any]]:
    """Scores by shots and error of light of the reconstructions of a tree."""
    plant = apple_tree(**settings.plant.model_dump(), seed=stream_seed(settings.seed, "plant"))
    true = {"leaf": plant.leaves, "wood": plant.wood}
    truth, _ = by_surfels.sunlit(true, settings, plant.wood)
    scan = settings.scan.model_dump()
    around = {"n": scan.pop("positions"), "radius_m": scan.pop("radius_m")}
    places_m = scanner.positions_around(
        stem_position(plant.wood), **around, height_m=scan.pop("height_m")
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "shots.parquet"
        seed = stream_seed(settings.seed, "scan")
        shots.write_chunks(
            path, scanner.scan_chunks(true, places_m, **scan, ground_z_m=0.0, seed=seed)
        )
        cloud = by_surfels.classified(path, settings)
        fired = shots.read(path)
        own = shots.select(fired, fired.scan == LEFT_OUT)
        others = shots.select(fired, fired.scan != LEFT_OUT)
        for name, size, meshes, voxels in rebuilt(settings, cloud, others):
            beam = {
                "exit_aperture_m": settings.surfels.beam_diameter_m,
                "beam_divergence_mrad": settings.surfels.beam_divergence_mrad,
                "sub_rays": settings.rescan.sub_rays,
                "min_separation_m": settings.rescan.min_separation_m,
            }
            scored = steps.rescan(
                meshes,
                voxels,
                shots.parts(own),
                cloud,
                layers=1,
                tolerance_m=settings.rescan.tolerance_m,
                max_deviation=settings.clean.max_deviation,
                seed=settings.seed,
                **beam,
            ).iloc[0]
            seen, _ = by_surfels.sunlit(meshes, settings, plant.wood, voxels)
            facts = scored.drop(["layer", "zone"]).to_dict()
            light = by_surfels.scores(seen, truth)
            yield {"reconstruction": name, "setting": size} | facts | light


def rebuilt(settings: Settings, cloud: Cloud, others: shots.Shots) -> Iterator[tuple]:
    """Reconstructions from some shots: name, setting, meshes, voxels."""
    majority_m, deviation = settings.classify.majority_voxel_m, settings.clean.max_deviation
    points = seen_from(
        shots.parts(others),
        cloud,
        majority_voxel_m=majority_m,
        max_deviation=deviation,
        thin_voxel_m=settings.clean.thin_voxel_m,
    )
    seed, usual = settings.seed, settings.polygons.model_dump()
    wood = {"wood": steps.polygons(points, seed=seed, **usual)["wood"]}
    for size_m in POLYGONS_M:
        how = usual | {"voxel_size_m": size_m}
        yield "polygons", size_m, steps.polygons(points, seed=seed, **how), None
    for overlap in OVERLAPS:
        how = settings.surfels.model_dump() | {"overlap": overlap, "max_deviation": deviation}
        leaves, _ = steps.surfels(points, others, seed=seed, **how)
        yield "surfels", overlap, wood | {"leaf": leaves}, None
    kinds = steps.return_kinds(cloud, majority_m)
    how = settings.voxels.model_dump(exclude={"sizes_m"})
    for size_m in VOXELS_M:
        density = steps.voxels(shots.parts(others), points, size_m, kinds=kinds, **how)
        yield "voxels", size_m, wood, density


if __name__ == "__main__":
    main()
